"""
What a person sees while cells render: on a terminal bars that say what renders now, how far, how long still;
elsewhere one line per change of state. Everything goes to stderr: stdout is for results.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator

from rich.console import Console, Group
from rich.live import Live
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.table import Column
from rich.text import Text

from jobs.dispatcher import News
from jobs.executors.base import Failed, Finished, Passed
from jobs.experiments import Standing
from jobs.plan import Plan

console = Console(stderr=True, highlight=False)


class Remaining(ProgressColumn):
    """``≈ 1 min 20 s left``, from ``seconds_left`` of the task; nothing until it is known."""

    max_refresh = 0.5

    def render(self, task: Task) -> Text:
        left = task.fields.get("seconds_left")
        return Text("" if left is None else f"≈ {duration(left)} left", style="cyan", no_wrap=True)


class Follower:
    """
    Turns the dispatcher's news into bars or lines, and learns from them how long the rest takes.

    samples_left  samples still to be drawn; the rate is that of the renders seen so far, so the estimate knows this
                  machine and needs no table of speeds
    """

    def __init__(self, plan: Plan, samples_left: float, before: Standing):
        replicates, had = before.wanted, before.had
        self.labels = {cell.spec.digest: (cell.scene, cell.integrator, cell.sampler) for cell in plan.cells}
        self.samples_left = samples_left
        self.replicates, self.had = replicates, had
        self.drawn_samples = self.drawn_seconds = 0.0
        self.live = console.is_terminal
        # Two tables: one row's long name must not push the other row's numbers off a narrow terminal.
        self.whole = Progress(
            TextColumn("pictures"), BarColumn(bar_width=28), TextColumn("{task.fields[count]}"), Remaining(),
            console=console,
        )  # fmt: skip
        self.one = Progress(
            BarColumn(bar_width=8),
            TextColumn("{task.description}", table_column=Column(no_wrap=True, overflow="ellipsis")),
            console=console,
        )
        self.total = self.whole.add_task("", total=max(replicates, 1), completed=had, count=f"{had}/{replicates}")
        self.now = self.one.add_task("starting the renderer", total=None)
        self.bars = Live(Group(self.whole, self.one), console=console, refresh_per_second=8)

    def __enter__(self) -> Follower:
        if self.live:
            self.bars.start()
        else:
            console.print(f"{self.replicates - self.had} pictures to render, {self.had} are there")
        return self

    def __exit__(self, *error: object) -> None:
        if self.live:
            self.one.update(self.now, visible=False)
            self.whole.update(self.total, seconds_left=None)
            self.bars.stop()

    def hear(self, news: News) -> None:
        """One piece of news from the dispatcher."""
        scene, integrator, sampler = self.labels.get(news.work.digest, ("", "", ""))
        name = f"{scene} · {integrator} · {sampler} · {news.work.spec.spp} spp"
        match news.event:
            case Passed(role=role, k=k, done=done, passes=passes):
                self._now(f"{name} · {_replicate(role, k)} · pass {done}/{passes}", done, passes)
            case Finished(role=role, k=k) as finished:
                self._count(news, finished)
                self._now(f"{name} · {_replicate(role, k)}", 1, 1)
            case Failed(error_class=error_class, message=message):
                again = "" if news.kind == "failed" else "; it is tried again"
                console.print(f"[red]{error_class}[/red] in {name}: {message}{again}", soft_wrap=True)
        if news.kind == "done" and not self.live:
            console.print(f"{self.had:4}/{self.replicates}  {name}{self._left()}", soft_wrap=True)

    def _now(self, description: str, completed: int, total: int) -> None:
        self.one.update(self.now, description=description, completed=completed, total=total)

    def _count(self, news: News, finished: Finished) -> None:
        width, height = news.work.spec.estimand.size
        samples = width * height * news.work.spec.spp
        self.had += 1
        self.samples_left = max(self.samples_left - samples, 0)
        self.drawn_samples += samples
        self.drawn_seconds += finished.render_seconds + finished.compile_seconds
        count = f"{self.had}/{self.replicates}"
        self.whole.update(self.total, completed=self.had, count=count, seconds_left=self.seconds_left())

    def seconds_left(self) -> float | None:
        """Estimate of the time still needed, None before anything was drawn."""
        return self.samples_left * self.drawn_seconds / self.drawn_samples if self.drawn_samples else None

    def _left(self) -> str:
        left = self.seconds_left()
        return f"  (≈ {duration(left)} left)" if left else ""


@contextlib.contextmanager
def single_bar(what: str) -> Iterator[Callable[[int, int], None]]:
    """A bar for one picture; gives a function (passes done, passes)."""
    bars = Progress(
        TextColumn("{task.description}"), BarColumn(bar_width=28), TextColumn("{task.fields[count]}"), Remaining(),
        console=console, disable=not console.is_terminal, transient=True,
    )  # fmt: skip
    with bars:
        task = bars.add_task(f"rendering {what}", total=None, count="")
        start = time.monotonic()

        def advance(done: int, passes: int) -> None:
            left = (time.monotonic() - start) * (passes - done) / done if done else None
            bars.update(task, total=passes, completed=done, count=f"pass {done}/{passes}", seconds_left=left)

        yield advance


def duration(seconds: float) -> str:
    """``40 s``, ``1 min 20 s``, ``3 h 5 min``: two units at most."""
    whole = max(round(seconds), 1)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def _replicate(role: str, k: int) -> str:
    return f"reference {k + 1}" if role == "reference" else f"replicate {k + 1}"
