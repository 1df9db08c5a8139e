# The Dartboard service: docker compose up --build (docker-compose.yml says how it is kept in its place).
FROM python:3.12-slim-bookworm

# Mitsuba compiles with it; 15 and 16 abort, older ones are refused (renderer/llvm.py).
RUN apt-get update \
 && apt-get install --no-install-recommends -y libllvm19 \
 && rm -rf /var/lib/apt/lists/*

WORKDIR /app
COPY requirements.lock ./
RUN pip install --no-cache-dir --no-deps --only-binary :all: --require-hashes -r requirements.lock

# The folders are the packages, as in a checkout.
COPY LICENSE ./
COPY renderer renderer/
COPY jobs jobs/
COPY service service/
COPY web web/
RUN echo /app > "$(python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/dartboard.pth" \
 && python -m compileall -q renderer jobs service

# Nobody's home: compiled kernels then lie in the data directory, which outlives the container.
RUN useradd --uid 10001 --no-create-home --home-dir /nonexistent --shell /usr/sbin/nologin dartboard \
 && install -d -o dartboard -g dartboard /data
ENV HOME=/nonexistent PYTHONDONTWRITEBYTECODE=1 PYTHONUNBUFFERED=1 DARTBOARD_DATA=/data
USER 10001:10001
VOLUME /data
EXPOSE 8000

# Without the proxy that an environment may name; an answer that is no success is an error.
HEALTHCHECK --interval=15s --timeout=10s --start-period=60s \
  CMD ["python", "-c", "from urllib.request import ProxyHandler, build_opener; build_opener(ProxyHandler({})).open('http://127.0.0.1:8000/api/health', timeout=5)"]

# Off loopback the service demands a token (DARTBOARD_TOKEN), so a container without one does not start.
ENTRYPOINT ["python", "-P", "-m", "service.cli", "serve", "--host", "0.0.0.0", "--port", "8000"]
