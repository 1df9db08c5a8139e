"""
What must hold of the container, read from its files: published on loopback only, nobody's root, versions of the lock.

No Docker engine is needed. Where `docker compose` is there, it is asked whether it reads the file as we do.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import pytest
import yaml

from renderer import llvm

HOME = Path(__file__).resolve().parent.parent
TOKEN = "0123456789abcdef"


def instructions() -> list[tuple[str, str]]:
    """(word, rest) of each instruction of the Dockerfile, without comments, continued lines joined."""
    text = re.sub(r"^\s*#.*\n", "", (HOME / "Dockerfile").read_text(), flags=re.MULTILINE).replace("\\\n", " ")
    found = [line.split(maxsplit=1) for line in text.splitlines() if line.strip()]
    return [(word, rest.strip()) for word, rest in found]


def every(word: str) -> list[str]:
    return [rest for found, rest in instructions() if found == word]


def command(word: str) -> list[str]:
    """The JSON list of the last ENTRYPOINT or of the HEALTHCHECK's CMD."""
    return json.loads(every(word)[-1].partition("CMD ")[2] or every(word)[-1])


@pytest.fixture(scope="module")
def service() -> dict[str, Any]:
    told = yaml.safe_load((HOME / "docker-compose.yml").read_text())
    (service,) = told["services"].values()
    assert [volume.partition(":")[0] for volume in service["volumes"]] == list(told["volumes"])
    return service


def test_the_port_is_published_on_loopback_only(service: dict[str, Any]) -> None:
    assert all(re.fullmatch(r"127\.0\.0\.1:\S+:8000", port) for port in service["ports"])
    assert len(service["ports"]) == 1
    assert "network_mode" not in service
    assert every("EXPOSE") == ["8000"]
    assert command("ENTRYPOINT")[-4:] == ["--host", "0.0.0.0", "--port", "8000"]


def test_nothing_starts_without_a_token(service: dict[str, Any]) -> None:
    assert re.match(r"\$\{DARTBOARD_TOKEN:\?.+16.+\}", service["environment"]["DARTBOARD_TOKEN"])


def test_data_outlives_the_container(service: dict[str, Any]) -> None:
    """A named volume at the data directory, which belongs to the user of the image."""
    assert [volume.partition(":")[2] for volume in service["volumes"]] == ["/data"]
    assert any("DARTBOARD_DATA=/data" in rest for rest in every("ENV"))
    assert any("install -d -o dartboard -g dartboard /data" in rest for rest in every("RUN"))


def test_it_is_not_root_and_may_do_little(service: dict[str, Any]) -> None:
    words = [word for word, _ in instructions()]
    assert words.index("USER") > len(words) - 1 - words[::-1].index("RUN")  # after the last thing that needs root
    (user,) = every("USER")
    assert user == service["user"] and re.fullmatch(r"[1-9]\d+:[1-9]\d+", user)
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert not {"privileged", "cap_add", "devices", "pid", "ipc"} & set(service)


def test_its_health_is_checked(service: dict[str, Any]) -> None:
    """The same way by Docker alone and by compose, and with nothing that the image lacks."""
    check = command("HEALTHCHECK")
    assert service["healthcheck"]["test"] == ["CMD", *check]
    assert check[:2] == ["python", "-c"]
    compile(check[2], "HEALTHCHECK", "exec")
    assert "http://127.0.0.1:8000/api/health" in check[2]


def test_packages_are_those_of_the_lock() -> None:
    """Each checked against its hash; LLVM by the number that works."""
    (install,) = (rest for rest in every("RUN") if "pip install" in rest)
    assert {"--require-hashes", "--no-deps", "--only-binary"} <= set(shlex.split(install))
    assert install.endswith("-r requirements.lock")
    (base,) = every("FROM")
    assert re.fullmatch(r"python:3\.1[123]-slim-bookworm", base)
    (number,) = re.findall(r"libllvm(\d+)", " ".join(every("RUN")))
    assert int(number) >= llvm.OLDEST


def test_what_is_copied_is_there_and_not_ignored() -> None:
    rules = [line for line in (HOME / ".dockerignore").read_text().splitlines() if line and line[0] != "#"]
    kept = {rule[1:] for rule in rules if rule[0] == "!"}
    copied = {source for rest in every("COPY") for source in rest.split()[:-1]}
    assert rules[0] == "*" and copied == kept
    assert all((HOME / source).exists() for source in copied)
    assert {"renderer", "jobs", "service", "web"} <= copied
    assert any(fnmatch("web/node_modules", rule) for rule in rules[1:])


def test_compose_reads_it_as_we_do(service: dict[str, Any]) -> None:
    """And refuses to start without a token, in words that help."""
    asked = ["docker", "compose", "-f", str(HOME / "docker-compose.yml"), "config", "--format", "json"]
    if not shutil.which("docker") or subprocess.run([*asked[:2], "version"], capture_output=True).returncode:
        pytest.skip("no `docker compose` on this machine")
    bare = {name: value for name, value in os.environ.items() if not name.startswith("DARTBOARD_")}
    told = subprocess.run(asked, capture_output=True, text=True, env={**bare, "DARTBOARD_TOKEN": TOKEN})
    assert told.returncode == 0, told.stderr
    (read,) = json.loads(told.stdout)["services"].values()
    (port,) = read["ports"]
    assert (port["host_ip"], port["published"], port["target"]) == ("127.0.0.1", "8000", 8000)
    assert read["environment"]["DARTBOARD_TOKEN"] == TOKEN
    assert read["healthcheck"]["test"] == service["healthcheck"]["test"]
    (volume,) = read["volumes"]
    assert (volume["type"], volume["target"]) == ("volume", "/data")
    refused = subprocess.run(asked, capture_output=True, text=True, env=bare)
    assert refused.returncode != 0 and "16 characters" in refused.stderr
