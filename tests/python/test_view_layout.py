"""The layout of the pages of `haff view`: no part covers another, in wide and in narrow windows."""

import itertools

import pytest

import synthetic

PARTS = ("header", "main", "#beside", "#curves", "footer")
BOXES = """(names) => names.flatMap((name) => [...document.querySelectorAll(name)])
  .filter((e) => e.checkVisibility() && e.getClientRects().length)
  .map((e) => { const r = e.getBoundingClientRect();
                return [e.id || e.tagName, r.left, r.top + scrollY, r.right, r.bottom + scrollY]; })"""
CONTROLS = (
    "button, select, input, output, #legend p, #caption, #entries, #facts dd, h1, header p:not(:empty), canvas#stage"
)


@pytest.fixture
def gas(tmp_path):
    """A rough gas with a long title: spins, losses and an event log."""
    return synthetic.cooling_gas(tmp_path / "gas.h5", n=300, frames=4, collisions=400, beta=0.5)


def overlapping(boxes):
    """Pairs of boxes that share more than a pixel each way."""
    for (a, *p), (b, *q) in itertools.combinations(boxes, 2):
        if min(p[2], q[2]) - max(p[0], q[0]) > 1 and min(p[3], q[3]) - max(p[1], q[1]) > 1:
            yield a, b


@pytest.mark.long
@pytest.mark.parametrize(("width", "height"), [(1280, 800), (720, 480), (480, 800), (390, 800), (360, 640), (800, 360)])
def test_no_part_covers_another_or_leaves_the_window(show, gas, width, height):
    page = show(gas, width=width, height=height)
    folded = page.is_visible("#more")
    for more, number, coloring in (
        (False, None, "species"), (True, None, "species"), (False, None, "recent"), (False, 7, "speed"),
        (True, 7, "density"),
    ):  # fmt: skip
        page.evaluate(f"haffView.player.showMore({str(more).lower()})")
        page.evaluate(f"haffView.player.inspector.choose({'null' if number is None else number})")
        page.evaluate(f"haffView.player.colors.choose('{coloring}')")
        page.wait_for_function("(haffView.player.draw(), !beside.textContent.includes('…'))")
        parts = page.evaluate(BOXES, list(PARTS))
        assert not list(overlapping(parts)), f"{width}×{height}, {coloring}"
        controls = page.evaluate(BOXES, [CONTROLS])
        assert len({name for name, *_ in controls}) > (5 if folded and not more else 15)
        # What is beside the scene may be longer than that, and scrolls there.
        if width <= 600 or (number is None and height >= 480):
            assert not list(overlapping(controls)), f"{width}×{height}, {coloring}"
        for name, left, _top, right, _bottom in [*parts, *controls]:
            assert left >= -0.5 and right <= width + 0.5, f"{name} is cut off at {width}×{height}"
        assert page.evaluate("document.scrollingElement.scrollWidth") <= width
        stage = page.locator("#stage").bounding_box()
        assert stage["width"] >= 150 and stage["height"] >= 148


@pytest.mark.long
@pytest.mark.parametrize("name", ["cooling", "disks"])
@pytest.mark.parametrize(("width", "height"), [(1280, 800), (390, 800)])
def test_legend_is_beside_the_scene_and_the_box_fills_its_own_area(show, files, name, width, height):
    page = show(files[name], width=width, height=height)
    page.keyboard.press("e")
    page.evaluate("haffView.player.view.look()")
    stage, legend = (page.locator(part).bounding_box() for part in ("#stage", "#legend"))
    if width > 600:
        assert legend["x"] + legend["width"] <= stage["x"]
    else:
        assert legend["y"] >= stage["y"] + stage["height"] - 1
    # All corners of the box are in the canvas.
    size = page.evaluate("header.room.size")
    corners = [[size[k] * bit for k, bit in enumerate(bits)] for bits in itertools.product((0, 1), repeat=3)]
    seen = [page.evaluate("p => haffView.player.pixel(p)", place) for place in corners]
    x, y = [p["x"] for p in seen], [p["y"] for p in seen]
    assert stage["x"] <= min(x) and max(x) <= stage["x"] + stage["width"]
    assert stage["y"] <= min(y) and max(y) <= stage["y"] + stage["height"]
    # It fills most of the area along one axis; margins are for particles that reach through its faces.
    assert max((max(x) - min(x)) / stage["width"], (max(y) - min(y)) / stage["height"]) > 0.7


@pytest.mark.long
def test_scene_stays_in_view_when_the_window_changes(show, files):
    page = show(files["cooling"], width=1280, height=800)
    page.keyboard.press("d")
    page.set_viewport_size({"width": 390, "height": 800})
    page.wait_for_function(
        "stage.clientWidth <= 390 && haffView.player.view.camera.aspect < 390 / stage.clientHeight + 0.01"
    )
    stage = page.locator("#stage").bounding_box()
    size = page.evaluate("header.room.size")
    for place in ([0, 0, 0], size, [size[0], 0, 0], [0, size[1], size[2]]):
        at = page.evaluate("p => haffView.player.pixel(p)", place)
        assert stage["x"] < at["x"] < stage["x"] + stage["width"]
        assert stage["y"] < at["y"] < stage["y"] + stage["height"]


@pytest.mark.long
def test_nothing_moves_while_a_page_plays(show, gas):
    page = show(gas, width=390, height=800)
    page.keyboard.press("i")
    places = set()
    for step in range(31):
        page.evaluate(f"haffView.player.goto({step / 10})")
        page.evaluate("haffView.player.draw()")
        places.add(str(page.evaluate(BOXES, ["main", "#legend", "#particle", "footer"])))
    assert len(places) == 1


@pytest.mark.long
def test_controls_have_names_for_screen_readers(show, files):
    page = show(files["cooling"])
    unnamed = page.evaluate(
        """() => [...document.querySelectorAll('button, select, input, main canvas')]
             .filter((e) => !e.closest('dialog, label') && !e.ariaHidden && !e.getAttribute('aria-label'))
             .map((e) => e.id)"""
    )
    assert unnamed == []
    page.keyboard.press("?")
    keys = page.locator("#keys").text_content()
    for action in ("linear or logarithmic time", "fixed range", "opaque", "numbers of a particle"):
        assert action in keys
