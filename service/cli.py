"""
The command line: ``dartboard COMMAND``.

Thin on purpose: types in, one call, words out. Nothing here imports Mitsuba, and what a command does not need
(an HTTP client, a server) is imported inside it, so that ``--help``, ``check`` and ``results`` answer at once. With
``--json`` stdout holds JSON and nothing else. Exit codes: 0 done, 1 some cells failed, 2 bad input, 3 environment,
130 interrupted.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from renderer.errors import DartboardError

if TYPE_CHECKING:
    from service.control import Action

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
Server = Annotated[
    str | None,
    typer.Option(
        "--server", metavar="URL", help="A running server instead of a data directory (else DARTBOARD_SERVER)."
    ),
]
Device = Annotated[str, typer.Option(help="auto, llvm (the CPU) or cuda.")]
Port = Annotated[int, typer.Option(min=0, max=65535, help="TCP port; 0 takes a free one.")]
Json = Annotated[bool, typer.Option("--json", help="JSON on stdout.")]
GridFile = Annotated[Path, typer.Argument(metavar="GRID", help="A grid file, such as examples/first.toml.")]
ExperimentName = Annotated[
    str, typer.Argument(metavar="EXPERIMENT", help="Its id, or its name (the newest of that name).")
]


@app.command()
def up(data: Data = None, port: Port = 8000, device: Device = "auto") -> None:
    """Serve the dashboard on this machine; an empty data directory gets a demo grid to look at."""
    _serve(data, "127.0.0.1", port, device, demo=True)


@app.command()
def serve(
    data: Data = None,
    host: Annotated[
        str, typer.Option(help="Address to listen on; one that other machines reach needs DARTBOARD_TOKEN.")
    ] = "127.0.0.1",
    port: Port = 8000,
    device: Device = "auto",
) -> None:
    """Serve the dashboard and the REST API, and render what is submitted."""
    _serve(data, host, port, device, demo=False)


def _serve(data: Path | None, host: str, port: int, device: str, *, demo: bool) -> None:
    from service.serve import serve
    from service.settings import data_directory

    token = os.environ.get("DARTBOARD_TOKEN") or None
    raise typer.Exit(serve(data_directory(data), host=host, port=port, device=device, demo=demo, token=token))


@app.command()
def run(
    grid: GridFile,
    data: Data = None,
    device: Device = "auto",
    executor: Annotated[str, typer.Option(help="Where cells render: local (this machine).")] = "local",
    report: Annotated[
        Path | None, typer.Option(metavar="OUT.html", help="Write a report of the experiment at the end.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Run a grid to its end, with progress. Run it again: only what is missing is rendered."""
    from service.runner import run_grid
    from service.settings import data_directory

    place = data_directory(data)
    raise typer.Exit(run_grid(grid, place, device=device, executor=executor, report=report, as_json=as_json))


@app.command()
def submit(
    grid: GridFile,
    server: Server = None,
    wait: Annotated[
        bool, typer.Option("--wait", help="Follow it to its end; Ctrl-C lets go, the server goes on.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Hand a grid and its scenes to a running server."""
    from service.remote import submit_grid
    from service.settings import server_address

    raise typer.Exit(submit_grid(grid, server_address(server), wait=wait, as_json=as_json))


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
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="A built-in scene, a scene file, or its folder.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT.exr", help="The picture to write.")],
    integrator: Annotated[str | None, typer.Option(help="NAME or NAME:key=value,… (else the scene's).")] = None,
    sampler: Annotated[str | None, typer.Option(help="NAME or NAME:key=value,… (else the scene's).")] = None,
    spp: Annotated[int | None, typer.Option(help="Samples per pixel (else the scene's).")] = None,
    seed: Annotated[int, typer.Option(help="Which replicate: another number, other samples.", min=0)] = 0,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Resolution in pixels (else the scene's).")] = None,
    max_depth: Annotated[int | None, typer.Option(help="Edges of the longest path; -1: unlimited.")] = None,
    crop: Annotated[str | None, typer.Option(metavar="X,Y,W,H", help="Part of the film (else the scene's).")] = None,
    rfilter: Annotated[str | None, typer.Option(help="Pixel filter: NAME or NAME:key=value,…")] = None,
    device: Device = "auto",
    as_json: Json = False,
) -> None:
    """Render one picture, outside of the queue."""
    from service.single import render_one

    told = render_one(
        scene, output, integrator=integrator, sampler=sampler, spp=spp, seed=seed, size=size, max_depth=max_depth,
        crop=crop, rfilter=rfilter, device=device,
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
def points(
    sampler: Annotated[str, typer.Argument(metavar="SAMPLER", help="NAME or NAME:key=value,…")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE.npz", help="The file to write.")],
    spp: Annotated[int, typer.Option(help="Samples per pixel: points of a set.")],
    sets: Annotated[int, typer.Option(min=1, help="Pixels whose points are drawn.")] = 64,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Another number, other points.")] = 0,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw points, spectrum and distances as well.")
    ] = None,
    device: Device = "auto",
    as_json: Json = False,
) -> None:
    """Write the points of a sampler, as a render draws them, and say how even they are."""
    from service.pointing import points_of, show

    told = points_of(sampler, output, spp=spp, sets=sets, seed=seed, plot=plot, device=device)
    _print_json(told) if as_json else show(told)


@app.command()
def bsdf(
    bsdf: Annotated[str, typer.Argument(metavar="BSDF", help="NAME or NAME:key=value,…, such as anisophong:nu=10.")],
    wi: Annotated[
        str, typer.Option(metavar="X,Y,Z", help="Direction to the viewer, in the local frame: n = z, u = x.")
    ],
    wo: Annotated[str, typer.Option(metavar="X,Y,Z", help="Direction to the light.")],
    device: Device = "auto",
    as_json: Json = False,
) -> None:
    """Evaluate a BSDF of ours for two directions: f·cos θo and the density of its sampling, per steradian."""
    from service.bsdfing import value_of

    told, notes = value_of(bsdf, wi, wo, device=device)
    for note in notes:
        _say(note)
    if as_json:
        _print_json(told)
    else:
        print(f"f·cos θo = {told['eval']}, pdf = {told['pdf']}")


@app.command("import")
def import_(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.pbrt", help="A pbrt-v3 scene file.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER", help="A new folder for the scene.")],
    as_json: Json = False,
) -> None:
    """Write a pbrt-v3 scene as a Mitsuba scene, for editing; say what was replaced or ignored."""
    from service.importing import import_scene, show

    told = import_scene(scene, output)
    _print_json(told) if as_json else show(told)


@app.command()
def results(
    experiment: ExperimentName,
    form: Annotated[str, typer.Option("--format", help="csv, json or table.")] = "table",
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write to a file instead of stdout.")] = None,
    data: Data = None,
    server: Server = None,
) -> None:
    """Export an experiment: one row per replicate, with its errors and times."""
    from service.settings import place

    match place(data, server):
        case str(url):
            from service.remote import download_results

            download_results(experiment, url, form, output)
        case folder:
            from service.readout import write_results

            write_results(experiment, folder, form, output)


@app.command()
def report(
    experiment: ExperimentName,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="The file to write.")],
    form: Annotated[str, typer.Option("--format", help="html.")] = "html",
    data: Data = None,
    server: Server = None,
) -> None:
    """Write an experiment as one file that opens anywhere: pictures, plots, tables, how to run it again."""
    from service.settings import place

    match place(data, server):
        case str(url):
            from service.remote import download_report

            download_report(experiment, url, form, output)
        case folder:
            from service.readout import report_of

            report_of(experiment, folder, form, output)


@app.command()
def status(
    experiment: Annotated[str | None, typer.Argument(metavar="[EXPERIMENT]")] = None,
    data: Data = None,
    server: Server = None,
    as_json: Json = False,
) -> None:
    """Say how far experiments are: cells by state, failures with their reason, who works on them."""
    from service.settings import place

    match place(data, server):
        case str(url):
            from service.remote import show_status_of

            show_status_of(url, experiment, as_json=as_json)
        case folder:
            from service.readout import show_status

            show_status(experiment, folder, as_json=as_json)


@app.command()
def cancel(experiment: ExperimentName, data: Data = None, server: Server = None) -> None:
    """Stop an experiment: what is done stays, the rest is not rendered (until retry or run)."""
    _change("cancel", experiment, data, server)


@app.command()
def retry(experiment: ExperimentName, data: Data = None, server: Server = None) -> None:
    """Queue the failed and cancelled cells of an experiment again."""
    _change("retry", experiment, data, server)


@app.command()
def pause(experiment: ExperimentName, data: Data = None, server: Server = None) -> None:
    """Let an experiment rest, so that others are rendered first; resume goes on."""
    _change("pause", experiment, data, server)


@app.command()
def resume(experiment: ExperimentName, data: Data = None, server: Server = None) -> None:
    """Go on with an experiment that was paused."""
    _change("resume", experiment, data, server)


def _change(what: Action, experiment: str, data: Path | None, server: str | None) -> None:
    from service.settings import place

    match place(data, server):
        case str(url):
            from service.remote import change_there

            print(change_there(what, experiment, url))
        case folder:
            from service.control import change

            print(change(what, experiment, folder))


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
