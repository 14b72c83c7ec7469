"""benches/record.py and benches/starting.py: tables and figures from given measurements."""

import argparse
import importlib.util
import json
import stat
import sys
from pathlib import Path

import pytest

RECORD = Path(__file__).resolve().parents[2] / "benches/record.py"


@pytest.fixture(scope="module")
def record():
    spec = importlib.util.spec_from_file_location("record", RECORD)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def cell(name, n, phi, *rates, what="grid"):
    reports = [{"collisions_per_second": rate, "per_collision": {"predictions": 20.0}} for rate in rates]
    return {"what": what, "name": name, "n": n, "phi": phi, "command": f"{name} {n}", "reports": reports}


def page(record, cells, peers=()):
    at = {"system": "Linux x86_64", "processors": 2, "model": "Test", "l2": "1 MiB"}
    return record.markdown(
        {"title": "T", "date": "2026-01-31", "revision": "abc", "compiler": "rustc", "machine": at, "command": "c"}
        | {"threads": 1, "cells": cells, "peers": list(peers)}
    )


def test_rate_of_a_cell_is_the_median_of_its_repeats(record):
    table = record.summary({"cells": [cell("haff", 4000, 0.1, 3e6, 1e6, 1.5e6)]})
    assert table.loc[0, ["rate", "least", "most", "repeats"]].tolist() == [1.5e6, 1e6, 3e6, 3]


def test_ratio_is_that_to_the_fastest_peer_measured_in_alternation(record):
    quoted = {"name": "Quoted", "n": 4000, "phi": 0.1, "collisions_per_second": 9e6, "source": "a paper"}
    cells = [cell("haff", 4000, 0.1, 3e6), cell("A", 4000, 0.1, 1e6), cell("B", 4000, 0.1, 1.2e6)]
    text = page(record, cells, [quoted])
    row = next(line for line in text.splitlines() if line.startswith("| 4,000"))
    assert row.endswith("| B | 1.200 | 2.50 |"), row
    assert "- Quoted: a paper" in text and "- B: measured in alternation" in text
    # Quoted figures are used where no peer was measured.
    row = next(line for line in page(record, cells[:1], [quoted]).splitlines() if line.startswith("| 4,000"))
    assert row.endswith("| Quoted | 9.000 | 0.33 |"), row


def test_peers_need_their_columns_and_positive_numbers(record, tmp_path):
    path = tmp_path / "peers.csv"
    path.write_text("name,n,phi,collisions_per_second,source\nEDMD,4000,0.1,1.1e6,here\n")
    assert record.read_peers(path).to_dict("records") == [
        {"name": "EDMD", "n": 4000, "phi": 0.1, "collisions_per_second": 1.1e6, "source": "here"}
    ]
    path.write_text("name,n,phi\nEDMD,4000,0.1\n")
    with pytest.raises(SystemExit, match="no column collisions_per_second, source"):
        record.read_peers(path)
    path.write_text("name,n,phi,collisions_per_second,source\nEDMD,4000,0.1,1e6,x\nEDMD,4000,0.1,fast,x\n")
    with pytest.raises(SystemExit, match="collisions_per_second must be a positive number in row 3"):
        record.read_peers(path)


def test_commands_are_recorded_without_local_paths(record):
    words = [
        "--haff",
        "/opt/haff",
        "--n",
        "4000",
        "--peer",
        "A=/opt/a/run {n} x={phi}",
        "--peers=/opt/p.csv",
        "-o",
        "/x",
    ]
    assert record.command_words(words) == ["--n", "4000", "--peer", "A=run {n} x={phi}", "--peers", "p.csv"]


def test_invalid_arguments_are_refused(record):
    for text in ("1,x", "-1", "0", "1.5"):
        with pytest.raises(argparse.ArgumentTypeError):
            record.numbers(int)(text)
    assert record.numbers(int)("4_000,1e6") == [4000, 1_000_000]
    for text in ("noequals", "=x", "haff=x", "A=run {where}"):
        with pytest.raises(argparse.ArgumentTypeError):
            record.named_command(text)


def stand_in(path, rate):
    """A program that prints its arguments and a rate, as a peer does."""
    path.write_text(
        f"#!{sys.executable}\nimport json, sys\n"
        f"print(json.dumps({{'collisions_per_second': {rate}, 'per_collision': {{}}, 'words': sys.argv[1:]}}))\n"
    )
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


@pytest.mark.long
def test_record_has_every_cell_of_haff_and_peers_and_a_figure(record, tmp_path, monkeypatch, capsys):
    ours, peer = stand_in(tmp_path / "haff", 2e6), stand_in(tmp_path / "other", 1e6)
    words = ["--haff", str(ours), "--n", "100,200", "--phi", "0.1,0.3", "--repeats", "2", "--collisions", "50"]
    words += ["--peer", f"Other={peer} {{n}} {{phi}} {{collisions}}", "-o", str(tmp_path / "out")]
    monkeypatch.setattr(sys, "argv", ["record.py", *words])
    record.main()
    assert "| 2.00 |" in capsys.readouterr().out
    written = json.loads((tmp_path / "out/throughput.json").read_text())
    assert [(c["name"], c["n"], c["phi"]) for c in written["cells"]] == [
        (name, n, phi) for n in (100, 200) for phi in (0.1, 0.3) for name in ("haff", "Other")
    ]
    assert all(len(c["reports"]) == 2 for c in written["cells"])
    assert written["cells"][1]["reports"][0]["words"] == ["100", "0.1", "50"]
    arguments = written["cells"][2]["reports"][0]["words"]
    assert arguments[arguments.index("--phi") + 1] == "0.3" and arguments[arguments.index("--collisions") + 1] == "50"
    assert str(tmp_path) not in json.dumps({k: v for k, v in written.items() if k != "cells"})
    assert str(tmp_path) not in "".join(c["command"] for c in written["cells"])
    assert (tmp_path / "out/throughput.png").stat().st_size > 10_000
    assert "# haff bench, scene fluid" in (tmp_path / "out/throughput.md").read_text()


def test_growth_series_vary_n_and_phi(record, tmp_path, monkeypatch):
    ours = stand_in(tmp_path / "haff", 2e6)
    words = ["--haff", str(ours), "--growth", "--growth-n", "1e3,1e4", "--growth-phi", "0.01,0.1", "--repeats", "1"]
    monkeypatch.setattr(sys, "argv", ["record.py", *words, "-o", str(tmp_path)])
    record.main()
    cells = json.loads((tmp_path / "growth.json").read_text())["cells"]
    assert [(c["n"], c["phi"]) for c in cells] == [
        *((n, phi) for phi in (0.05, 0.49) for n in (1000, 10_000)),
        *((32_000, phi) for phi in (0.01, 0.1)),
    ]
    assert (tmp_path / "growth.png").stat().st_size > 10_000


def test_measured_part_replaces_only_its_section_of_the_page(record, tmp_path):
    page = tmp_path / "throughput.md"
    page.write_text("# By hand\n\n<!-- begin grid -->\nold\n<!-- end grid -->\n\n## Tried and lost\n")
    record.into_page(page, "Not used", {"grid": "new\n", "other": "more\n"})
    assert page.read_text() == (
        "# By hand\n\n<!-- begin grid -->\n\nnew\n\n<!-- end grid -->\n\n## Tried and lost\n"
        "\n<!-- begin other -->\n\nmore\n\n<!-- end other -->\n"
    )
    page.write_text("<!-- begin grid -->\n")
    with pytest.raises(SystemExit, match="must have both"):
        record.into_page(page, "T", {"grid": "new\n"})


def test_record_pages_have_their_sections_and_at_most_150_lines(record, monkeypatch):
    folder = RECORD.parent / "record"
    for name, sections in {"throughput": 1, "growth": 1, "accuracy": 1, "features": 3, "starting": 1}.items():
        text = (folder / f"{name}.md").read_text()
        assert text.count("<!-- begin ") == text.count("<!-- end ") == sections, name
    for page in folder.glob("*.md"):
        assert page.read_text().count("\n") <= 150, page.name
    monkeypatch.syspath_prepend(str(RECORD.parent))
    accuracy, starting = map(importlib.import_module, ("accuracy", "starting"))
    for name, markdown in (
        ("throughput", record.markdown),
        ("growth", record.markdown),
        ("accuracy", accuracy.markdown),
        ("starting", starting.markdown),
    ):
        made = markdown(json.loads((folder / f"{name}.json").read_text()))
        assert made in (folder / f"{name}.md").read_text(), f"--replot makes another {name}.md"


@pytest.mark.long
def test_start_is_timed_in_turn_and_tabulated_by_medians(tmp_path, monkeypatch, capsys):
    """The packages and programs are stand-ins: what is run, how often, and what becomes of the times."""
    monkeypatch.syspath_prepend(str(RECORD.parent))
    starting = importlib.import_module("starting")
    log = tmp_path / "log"
    program = tmp_path / "haff"
    program.write_text(
        f"#!{sys.executable}\nimport os, sys\nfrom pathlib import Path\nword = ' '.join(sys.argv[1:])\n"
        f"package = Path(os.environ['PYTHONPATH']).name\nopen({str(log)!r}, 'a').write(package + ' ' + word + '\\n')\n"
        "old = package == 'old'\nsys.exit(4 if 'missing' in word else 2 if old and 'shear' in word else 0)\n"
    )
    program.chmod(0o755)
    (tmp_path / "python3").symlink_to(program)
    monkeypatch.setattr(starting, "make_files", lambda haff, folder: None)
    packages = {"before": tmp_path / "old", "now": starting.ROOT / "python"}
    found = starting.cells(argparse.Namespace(haff=program, repeats=3), packages)
    told = log.read_text().splitlines()
    assert len(told) == 4 * 2 * len(starting.commands()) and told[:2] == ["old -c import haff", "python -c import haff"]
    assert all(len(cell["times"]["now"]) == 3 for cell in found)
    # A figure that the earlier package lacks has no times; any other failure ends it.
    assert [len(cell["times"]["before"]) for cell in found] == [3] * (len(found) - 1) + [0]
    record = {"date": "2026-01-31", "machine": {"model": "Test", "family": "1"}, "command": "c", "repeats": 3}
    record |= {"packages": {"before": "abc", "now": "def"}, "cells": [found[0], found[-1]]}
    found[0]["times"] = {"before": [(3.0, 2.0), (1.0, 1.0), (1.5, 9.0)], "now": [(0.1, 0.05)]}
    text = starting.markdown(record)
    assert "| `python -c import haff` | 1.50 (2.00) | 0.10 (0.05) |" in text and "--kind shear` | – |" in text
    failing = tmp_path / "failing"
    failing.write_text("#!/bin/sh\nexit 2\n")
    failing.chmod(0o755)
    with pytest.raises(SystemExit, match="failing plot: exit status 2, not 0"):
        starting.measure(["haff", "plot"], packages["now"], tmp_path, {"haff": str(failing)})


def test_error_of_a_failing_peer_has_its_name_and_output(record, tmp_path):
    broken = tmp_path / "broken"
    broken.write_text("#!/bin/sh\necho no such option >&2\nexit 2\n")
    broken.chmod(0o755)
    with pytest.raises(SystemExit, match=r"broken[\s\S]*exit status 2[\s\S]*no such option"):
        record.report_of([str(broken)])
    mute = stand_in(tmp_path / "mute", "None")
    with pytest.raises(SystemExit, match="no JSON with collisions_per_second"):
        record.report_of([str(mute)])
