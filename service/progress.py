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
from rich.markup import escape
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.table import Column
from rich.text import Text

from jobs.dispatcher import News
from jobs.executors.base import Failed, Finished, Passed
from jobs.plan import Plan
from service.names import cell_name, replicate_name

console = Console(stderr=True, highlight=False)


class Remaining(ProgressColumn):
    """``≈ 1 min 20 s left``, from ``seconds_left`` of the task; nothing until it is known."""

    max_refresh = 0.5

    def render(self, task: Task) -> Text:
        left = task.fields.get("seconds_left")
        return Text("" if left is None else f"≈ {duration(left)} left", style="cyan", no_wrap=True)


class Bars:
    """
    How far an experiment is: a bar for all its pictures and one for what is drawn now, or lines where is no terminal.

    wanted, had  pictures, references included
    """

    def __init__(self, wanted: int, had: int, now: str = "starting the renderer"):
        self.wanted, self.had = wanted, had
        self.seconds_left: float | None = None
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
        self.total = self.whole.add_task("", total=max(wanted, 1), completed=had, count=f"{had}/{wanted}")
        self.current = self.one.add_task(escape(now), total=None)
        self.bars = Live(Group(self.whole, self.one), console=console, refresh_per_second=8)

    def __enter__(self) -> Bars:
        if self.live:
            self.bars.start()
        else:
            console.print(f"{self.wanted - self.had} pictures to render, {self.had} are there")
        return self

    def __exit__(self, *error: object) -> None:
        if self.live:
            self.one.update(self.current, visible=False)
            self.whole.update(self.total, seconds_left=None)
            self.bars.stop()

    def now(self, description: str, completed: int, total: int | None) -> None:
        """What is drawn now, and how many of its passes are done."""
        self.one.update(self.current, description=escape(description), completed=completed, total=total)

    def count(self, had: int, seconds_left: float | None) -> None:
        """How many pictures are there, and how long the rest may take."""
        self.had, self.seconds_left = had, seconds_left
        self.whole.update(self.total, completed=had, count=f"{had}/{self.wanted}", seconds_left=seconds_left)

    def done(self, name: str) -> None:
        """A cell has all its pictures."""
        if not self.live:
            left = f"  (≈ {duration(self.seconds_left)} left)" if self.seconds_left else ""
            self.say(f"{self.had:4}/{self.wanted}  {name}{left}")

    def failed(self, name: str, error_class: str, message: str) -> None:
        console.print(f"[red]{error_class}[/red] in {escape(f'{name}: {message}')}", soft_wrap=True)

    def say(self, line: str) -> None:
        """A line that stays, above the bars."""
        console.print(escape(line), soft_wrap=True)


class Follower:
    """
    Turns the dispatcher's news into bars or lines, and learns from them how long the rest takes.

    samples_left  samples still to be drawn; the rate is that of the renders seen so far, so the estimate knows this
                  machine and needs no table of speeds
    """

    def __init__(self, plan: Plan, samples_left: float, bars: Bars):
        self.labels = {cell.spec.digest: (cell.scene, cell.integrator, cell.sampler) for cell in plan.cells}
        self.samples_left, self.bars = samples_left, bars
        self.drawn_samples = self.drawn_seconds = 0.0

    def hear(self, news: News) -> None:
        """One piece of news from the dispatcher."""
        spec = news.work.spec
        name = cell_name(*self.labels.get(news.work.digest, ("", "", "")), spec.spp, spec.estimand.sweep)
        match news.event:
            case Passed(role=role, k=k, done=done, passes=passes):
                self.bars.now(f"{name} · {replicate_name(role, k)} · pass {done}/{passes}", done, passes)
            case Finished(role=role, k=k) as finished:
                self._count(news, finished)
                self.bars.now(f"{name} · {replicate_name(role, k)}", 1, 1)
            case Failed(error_class=error_class, message=message):
                again = "" if news.kind == "failed" else "; it is tried again"
                self.bars.failed(name, error_class, message + again)
        if news.kind == "done":
            self.bars.done(name)

    def _count(self, news: News, finished: Finished) -> None:
        width, height = news.work.spec.estimand.size
        samples = width * height * news.work.spec.spp
        self.samples_left = max(self.samples_left - samples, 0)
        self.drawn_samples += samples
        self.drawn_seconds += finished.render_seconds + finished.compile_seconds
        self.bars.count(self.bars.had + 1, self.samples_left * self.drawn_seconds / self.drawn_samples)


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
