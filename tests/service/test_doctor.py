"""Laws of the doctor: every red line carries its cure, and it needs nothing that might be broken."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from renderer import llvm
from renderer.errors import EnvironmentProblem
from service import doctor as module
from service.doctor import Line, doctor, run_doctor

NAMES = [
    *("Python", "Mitsuba", "Dr.Jit", "LLVM", "CUDA", "SQLite", "cores", "memory"),
    *("disk", "data directory", "kernel cache"),
]


def line(lines: list[Line], name: str) -> Line:
    return next(one for one in lines if one.name == name)


def test_each_thing_that_a_picture_needs_is_looked_at(tmp_path):
    lines = doctor(tmp_path / "data")
    assert [one.name for one in lines] == NAMES
    assert all(one.remedy for one in lines if one.state != "ok")
    assert line(lines, "data directory").value.endswith("not there yet, the first run makes it")
    assert not (tmp_path / "data").exists()  # looking changes nothing


def test_json_and_exit_code_agree(tmp_path, capsys):
    code = run_doctor(tmp_path, as_json=True)
    told = json.loads(capsys.readouterr().out)
    assert [one["name"] for one in told["lines"]] == NAMES
    assert set(told["lines"][0]) == {"name", "state", "value", "remedy"}
    assert code == (0 if told["ok"] else 3)


def test_without_llvm_the_line_is_red_and_tells_the_cure(tmp_path, monkeypatch, capsys):
    def none_here(*_):
        raise EnvironmentProblem("no usable LLVM: this machine has only 15")

    monkeypatch.setattr(llvm, "choose", none_here)
    monkeypatch.setattr(module.devices, "DRIVER_FILES", (str(tmp_path / "nvidiactl"),))
    found = line(doctor(tmp_path), "LLVM")
    assert found.state == "bad" and "only 15" in found.value and "apt-get install libllvm19" in found.remedy
    assert run_doctor(tmp_path) == 3
    assert "apt-get install libllvm19" in " ".join(capsys.readouterr().out.split())


def test_sqlite_is_not_in_the_range_of_the_wal_reset_bug(tmp_path):
    found = line(doctor(tmp_path), "SQLite")
    assert found.state == "ok" and "bundled with apsw" in found.value


@pytest.mark.parametrize(
    ("lock", "says"),
    [
        (None, "owned by nobody now"),
        ("{half", "owned by nobody now"),
        ('{"pid": PID, "url": "http://127.0.0.1:1"}', "owned by process PID, which answers at http"),
        ('{"pid": PID, "url": null}', "owned by process PID"),
    ],
)
def test_the_data_directory_names_its_owner(tmp_path, lock, says):
    if lock is not None:
        (tmp_path / "owner.lock").write_text(lock.replace("PID", str(os.getpid())))
    assert says.replace("PID", str(os.getpid())) in line(doctor(tmp_path), "data directory").value


def test_a_dead_owner_is_called_dead(tmp_path):
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    (tmp_path / "owner.lock").write_text(json.dumps({"pid": gone.pid, "url": None}))
    assert f"process {gone.pid}, which is gone" in line(doctor(tmp_path), "data directory").value


def test_a_data_directory_that_is_a_file_is_red(tmp_path):
    (tmp_path / "data").write_text("")
    found = line(doctor(tmp_path / "data"), "data directory")
    assert found.state == "bad" and "--data" in found.remedy


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_data_directory_that_is_read_only_is_red(tmp_path):
    tmp_path.chmod(0o555)
    assert line(doctor(tmp_path), "data directory").state == "bad"


def test_the_doctor_leaves_mitsuba_out():
    code = (
        "import sys, pathlib\nfrom service.doctor import doctor\ndoctor(pathlib.Path('x'))\n"
        "print(sorted({'mitsuba', 'drjit'} & set(sys.modules)))"
    )
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=root)
    assert done.stdout.strip() == "[]", done.stderr
