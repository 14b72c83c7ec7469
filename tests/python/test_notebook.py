"""What notebooks show: figures that are returned, and tables of files, frames, results and simulations."""

import html.parser

import h5py
import numpy as np
import pytest
from matplotlib.figure import Figure

import haff

EVIL = "<script>alert(1)</script>&\x1b[31m"


class Tags(html.parser.HTMLParser):
    """Tags and texts of a page; fails where they are not nested."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: set[str] = set()
        self.texts: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)
        self.tags.add(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


def texts(shown: object) -> str:
    """Texts of the table of an object, which is well formed and holds no other elements."""
    page = Tags()
    page.feed(shown._repr_html_())
    page.close()
    assert page.open == [] and page.tags <= {"table", "caption", "tbody", "tr", "th", "td"}
    return "\n".join(page.texts)


@pytest.fixture
def evil(files, tmp_path):
    path = tmp_path / "gas.h5"
    path.write_bytes(files["cooling"].read_bytes())
    with h5py.File(path, "r+") as file:
        old = file["parameters/scene"][()].decode()
        del file["parameters/scene"]
        title = EVIL.replace("\x1b", "\\u001b")
        file["parameters/scene"] = "\n".join(
            f'title = "{title}"' if line.startswith("title") else line for line in old.splitlines()
        )
    return path


def test_tables_show_what_there_is_and_escape_its_text(evil):
    with haff.open(evil) as run:
        told = texts(run)
        assert "<script>alert(1)</script>&\\x1b[31m" in told
        assert "2,000 (grain)" in told and f"{len(run.observables)} samples" in told and "8, t = 0" in told
        frame = run.frames[-1]
        told = texts(frame)
        assert f"{frame.step:,}" in told and f"{frame.time:g}" in told and "2,000" in told and "periodic" in told
        # Small: neither the samples nor the vectors of a frame are read for it.
        assert "samples" not in haff.open(evil).__dict__ and not {"position", "velocity"} & set(frame.__dict__)
    assert "closed" in texts(run)


def test_table_of_a_damaged_file_names_the_damage(evil):
    with h5py.File(evil, "r+") as file:
        file["particles/all/species"][0] = 12345
    with haff.open(evil) as run:
        assert "particles/all/species[0] = 12345" in texts(run)


def test_tables_of_results_and_simulations(tmp_path):
    gas = haff.template("cooling")
    gas["title"] = EVIL
    live = haff.Simulation(gas, species__0__count=100)
    live.advance(1.0)
    before = live.state_hash
    told = texts(live)
    assert "<script>" in told and "100 (grain)" in told and f"{live.collisions:,}" in told
    assert live.state_hash == before
    result = haff.run(gas, species__0__count=100, run__until=1.0, file=tmp_path / "gas.h5")
    told = texts(result)
    assert result.state_hash in told and str(tmp_path / "gas.h5") in told and "until" in told
    # JSON has no NaN and no infinity.
    unknown = haff.Result({**result.report, "ledger_residual": None, "collisions_per_second": None}, None)
    assert texts(unknown).count("unknown") == 2 and "none" in texts(unknown)


@pytest.mark.long
def test_plot_returns_a_figure_and_writes_nothing(files, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with haff.open(files["cooling"]) as run:
        figure = run.plot("temperature")
        other = run.plot(kind="snapshot", index=0)
    assert isinstance(figure, Figure) and isinstance(other, Figure)
    assert "t = 0" in " ".join(text.get_text() for text in other.texts)
    shown = figure._repr_png_()
    assert shown.startswith(b"\x89PNG") and len(shown) > 10_000
    same = haff.plot(str(files["cooling"]), kind="temperature")
    assert np.array_equal(figure.axes[0].lines[1].get_ydata(), same.axes[0].lines[1].get_ydata())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
@pytest.mark.parametrize("name", ["gas.png", "gas.pdf", "gas.svg"])
def test_plot_writes_the_picture_that_is_named(files, tmp_path, name):
    figure = haff.plot(files["ball"], "energy", tmp_path / name)
    assert figure.axes and (tmp_path / name).stat().st_size > 5000


def test_plot_says_what_is_wrong(files, tmp_path):
    for source, kind, output, error in (
        (files["ball"], "pie", None, haff.ArgumentError),
        (files["ball"], "energy", tmp_path / "energy.bmp", haff.ArgumentError),
        (files["ball"], "structure", None, haff.NotApplicableError),
        (files["quiet"], "losses", None, haff.MissingDataError),
        (tmp_path / "none.h5", "energy", None, haff.FileError),
        (files["ball"], "energy", tmp_path / "none" / "energy.png", haff.FileError),
    ):
        with pytest.raises(error):
            haff.plot(source, kind, output)
    assert list(tmp_path.iterdir()) == []
