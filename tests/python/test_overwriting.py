"""One rule: what writes a file refuses to replace one, with exit status 2, unless asked to overwrite."""

import pytest

import haff
from haff import figures
from haff.command.main import main

REFUSED = "exists; --overwrite replaces it\n"


@pytest.mark.long
@pytest.mark.parametrize(
    ("arguments", "written"),
    [
        (["plot", "{}", "--kind", "energy", "-o", "."], "ball-energy.png"),
        (["plot", "{}", "--kind", "energy", "-o", ".", "--format", "pdf"], "ball-energy.pdf"),
        (["plot", "{}", "-o", "."], "ball-snapshot.png"),
        (["plot", "{}", "--movie", "ball.gif", "--frames", ":2"], "ball.gif"),
        (["view", "{}"], "ball.html"),
        (["export", "{}", "--to", "csv", "-o", "ball.csv"], "ball.csv"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else value,
)
def test_commands_refuse_to_replace_a_file(files, arguments, written, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arguments = [word.format(files["ball"]) for word in arguments]
    path = tmp_path / written
    path.write_text("of another program")
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == "" and err == f"haff: error: {written}: {REFUSED}"
    # Nothing else is written, either.
    assert [one.name for one in tmp_path.iterdir()] == [written]
    assert path.read_text() == "of another program"
    assert main([*arguments, "--overwrite"]) == 0
    assert path.stat().st_size > 1000
    assert main(arguments) == 2


def test_a_kind_asked_for_twice_is_drawn_once(files, tmp_path, capsys):
    assert main(["plot", str(files["ball"]), "--kind", "energy", "--kind", "energy", "-o", str(tmp_path)]) == 0
    assert capsys.readouterr().out.count("\n") == 1


@pytest.mark.long
def test_functions_refuse_to_replace_a_file(files, tmp_path):
    path = tmp_path / "ball-energy.png"
    with haff.open(files["ball"]) as run:
        first = [
            lambda **options: figures.save_all(run, ["energy"], tmp_path, **options),
            lambda **options: run.plot("energy", path, **options),
            lambda **options: haff.plot(files["ball"], "energy", path, **options),
        ]
        for write in first:
            path.write_text("of another program")
            with pytest.raises(haff.ArgumentError, match="exists; overwrite=True replaces it"):
                write()
            assert path.read_text() == "of another program"
            write(overwrite=True)
            assert path.read_bytes().startswith(b"\x89PNG")
        copy = tmp_path / "copy.png"
        copy.write_bytes(files["ball"].read_bytes())
        with pytest.raises(haff.ArgumentError, match="is the file that is read"):
            haff.plot(copy, "energy", copy, overwrite=True)
