"""Laws of the device choice: a name means one thing, a refusal carries its cure, and Mitsuba stays out of here."""

import subprocess
import sys
import time

import pytest

from renderer import devices, llvm
from renderer.errors import EnvironmentProblem, UnknownName


@pytest.fixture
def no_driver(monkeypatch, tmp_path):
    monkeypatch.setattr(devices, "DRIVER_FILES", (str(tmp_path / "nvidiactl"),))


@pytest.fixture
def llvm_here():
    try:
        return llvm.choose()
    except EnvironmentProblem as error:
        pytest.skip(str(error))


def test_auto_takes_the_cpu_where_no_driver_is(no_driver, llvm_here, monkeypatch):
    monkeypatch.delenv("DARTBOARD_DEVICE", raising=False)
    device = devices.pick()
    assert device.name == "llvm" and llvm_here.version in device.description and device.why == llvm_here.why
    assert device.environment["DRJIT_LIBLLVM_PATH"] == str(llvm_here.path)
    assert devices.available() == [device]


def test_the_environment_can_name_the_device(no_driver, monkeypatch):
    monkeypatch.setenv("DARTBOARD_DEVICE", "cuda")
    with pytest.raises(EnvironmentProblem, match="device 'cuda' cannot draw here: no NVIDIA driver.*device 'llvm'"):
        devices.pick()
    monkeypatch.setenv("DARTBOARD_DEVICE", "gpu")
    with pytest.raises(UnknownName, match="unknown device 'gpu' in DARTBOARD_DEVICE; known: auto, cuda, llvm"):
        devices.pick()


def test_a_name_given_beats_the_environment(no_driver, llvm_here, monkeypatch):
    monkeypatch.setenv("DARTBOARD_DEVICE", "cuda")
    assert devices.pick("llvm").name == "llvm"


def test_a_driver_file_without_a_driver_fails_the_trial_once(tmp_path, monkeypatch):
    """Real trial in a real child; its refusal is believed for a while, then asked again."""
    (tmp_path / "nvidiactl").touch()
    monkeypatch.setattr(devices, "DRIVER_FILES", (str(tmp_path / "nvidiactl"),))
    monkeypatch.setattr(llvm, "state_folder", lambda: tmp_path / "state")
    monkeypatch.setattr(devices, "_driver", lambda: "of this test")
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    if not (trouble := devices.cuda_trouble()):
        pytest.skip("CUDA works here")
    assert trouble.startswith("the trial ")
    started = time.monotonic()
    assert devices.cuda_trouble() == trouble
    assert time.monotonic() - started < 0.1  # a remembered verdict; a child takes longer to start Mitsuba
    note = llvm.read_note("cuda")
    llvm.write_note("cuda", {**note, "trouble": "old news", "asked_at": time.time() - devices.RETRY_SECONDS - 1})
    assert devices.cuda_trouble() == trouble


def test_hidden_gpus_are_no_gpus(tmp_path, monkeypatch):
    (tmp_path / "nvidiactl").touch()
    monkeypatch.setattr(devices, "DRIVER_FILES", (str(tmp_path / "nvidiactl"),))
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "")
    assert "hides every GPU" in devices.cuda_trouble()


def test_picking_leaves_mitsuba_out():
    code = (
        "import sys\nfrom renderer import devices\ndevices.available()\n"
        "print(sorted({'mitsuba', 'drjit', 'numpy'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr
