"""
The command line: ``dartboard COMMAND``.

Thin on purpose: types in, one call, words out. Nothing here imports Mitsuba, and what a command does not need
is imported inside it, so that ``--help``, ``check`` and ``results`` answer at once. With ``--json`` stdout
holds JSON and nothing else. Exit codes: 0 done, 1 some cells failed, 2 bad input, 3 environment, 130 interrupted.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from renderer.errors import DartboardError

app = typer.Typer(
    help="Rendering experiments that people can believe: grids of samplers × integrators × scenes on Mitsuba 3.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    rich_markup_mode=None,
)

Data = Annotated[
    Path | None, typer.Option("--data", help="Data directory (else DARTBOARD_DATA, else ./dartboard-data).")
]
Json = Annotated[bool, typer.Option("--json", help="JSON on stdout.")]
GridFile = Annotated[Path, typer.Argument(metavar="GRID", help="A grid file, such as examples/first.toml.")]
ExperimentName = Annotated[
    str, typer.Argument(metavar="EXPERIMENT", help="Its id, or its name (the newest of that name).")
]


@app.command()
def run(
    grid: GridFile,
    data: Data = None,
    device: Annotated[str, typer.Option(help="auto, llvm (the CPU) or cuda.")] = "auto",
    executor: Annotated[str, typer.Option(help="Where cells render: local (this machine).")] = "local",
    as_json: Json = False,
) -> None:
    """Run a grid to its end, with progress. Run it again: only what is missing is rendered."""
    from service.runner import run_grid
    from service.settings import data_directory

    raise typer.Exit(run_grid(grid, data_directory(data), device=device, executor=executor, as_json=as_json))


@app.command()
def check(grid: GridFile, data: Data = None, as_json: Json = False) -> None:
    """Say what a grid would render: cells, reused cells, rounded spp, time and disk. Renders nothing."""
    from service.checker import check_grid
    from service.settings import data_directory

    check_grid(grid, data_directory(data), as_json=as_json)


@app.command()
def catalog(as_json: Json = False) -> None:
    """List every sampler, integrator, scene, filter and metric with its parameters."""
    from renderer.catalog import as_json as values
    from service.tables import show_catalog

    _print_json(values()) if as_json else show_catalog(values())


@app.command()
def render(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="A built-in scene, a Mitsuba XML file, or its folder.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT.exr", help="The picture to write.")],
    integrator: Annotated[str | None, typer.Option(help="NAME or NAME:key=value,… (else the scene's).")] = None,
    sampler: Annotated[str | None, typer.Option(help="NAME or NAME:key=value,… (else the scene's).")] = None,
    spp: Annotated[int | None, typer.Option(help="Samples per pixel (else the scene's).")] = None,
    seed: Annotated[int, typer.Option(help="Which replicate: another number, other samples.", min=0)] = 0,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Resolution in pixels (else the scene's).")] = None,
    max_depth: Annotated[int | None, typer.Option(help="Edges of the longest path; -1: unlimited.")] = None,
    device: Annotated[str, typer.Option(help="auto, llvm (the CPU) or cuda.")] = "auto",
    as_json: Json = False,
) -> None:
    """Render one picture, outside of the queue."""
    from service.single import render_one

    told = render_one(
        scene, output, integrator=integrator, sampler=sampler, spp=spp, seed=seed, size=size, max_depth=max_depth,
        device=device,
    )  # fmt: skip
    if as_json:
        _print_json(told)
    else:
        print(
            f"{output}: {told['width']}×{told['height']}, {told['spp_actual']} spp of {told['sampler']}, "
            f"{told['integrator']}; rendered in {told['render_seconds']:.2f} s, "
            f"compiled in {told['compile_seconds']:.2f} s"
        )


@app.command()
def measure(
    image: Annotated[Path, typer.Argument(metavar="IMAGE.exr")],
    reference: Annotated[Path, typer.Argument(metavar="REFERENCE.exr")],
    as_json: Json = False,
) -> None:
    """Print every metric between two pictures, of any origin."""
    from service.measuring import measure_files
    from service.tables import show_metrics

    told = measure_files(image, reference)
    _print_json(told) if as_json else show_metrics(told)


@app.command()
def results(
    experiment: ExperimentName,
    form: Annotated[str, typer.Option("--format", help="csv, json or table.")] = "table",
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write to a file instead of stdout.")] = None,
    data: Data = None,
) -> None:
    """Export an experiment: one row per replicate, with its errors and times."""
    from service.readout import write_results
    from service.settings import data_directory

    write_results(experiment, data_directory(data), form, output)


@app.command()
def status(
    experiment: Annotated[str | None, typer.Argument(metavar="[EXPERIMENT]")] = None,
    data: Data = None,
    as_json: Json = False,
) -> None:
    """Say how far experiments are: cells by state, failures with their reason, who works on them."""
    from service.readout import show_status
    from service.settings import data_directory

    show_status(experiment, data_directory(data), as_json=as_json)


@app.command()
def cancel(experiment: ExperimentName, data: Data = None) -> None:
    """Stop an experiment: what is done stays, the rest is not rendered (until retry or run)."""
    from service.control import change
    from service.settings import data_directory

    print(change("cancel", experiment, data_directory(data)))


@app.command()
def retry(experiment: ExperimentName, data: Data = None) -> None:
    """Queue the failed and cancelled cells of an experiment again."""
    from service.control import change
    from service.settings import data_directory

    print(change("retry", experiment, data_directory(data)))


@app.command()
def doctor(data: Data = None, as_json: Json = False) -> None:
    """Say what this machine has and lacks, with the cure for each lack."""
    from service.doctor import run_doctor
    from service.settings import data_directory

    raise typer.Exit(run_doctor(data_directory(data), as_json))


def _version(wanted: bool) -> None:
    if wanted:
        from renderer import __version__

        print(f"dartboard {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Entry point: every error that a user can solve is one sentence on stderr and an exit code, no traceback."""
    try:
        app(standalone_mode=True)
    except DartboardError as error:
        _say(str(error))
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        _say("interrupted")
        sys.exit(130)
    except BrokenPipeError:  # `dartboard results … | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        sys.exit(0)
    except OSError as error:
        if os.environ.get("DARTBOARD_DEBUG"):
            raise
        place = f" ({error.filename})" if error.filename else ""
        _say(f"the system refused{place}: {error.strerror or error}")
        sys.exit(3)


def _say(text: str) -> None:
    for line in text.splitlines():
        print(f"dartboard: {line}", file=sys.stderr)


def _print_json(value: Any) -> None:
    print(json.dumps(value, indent=2, ensure_ascii=False))


if __name__ == "__main__":
    main()
