"""The page in a real browser: what it shows, what its controls do, and how it ends."""

import threading
import time

import numpy as np
import pytest
from browser import Browser, find_chromium

from hybrid_rt import Camera, GradientSky, Lambertian, Object, Plane, Scene, Sphere
from hybrid_rt.live.watch import LivePage
from hybrid_rt.rendering.renderer import render
from hybrid_rt.sensor.color import screen_pixels

pytestmark = pytest.mark.skipif(
    find_chromium() is None, reason="no Chromium here: apt-get install chromium"
)
WIDTH, HEIGHT = 48, 32
# The colour on the screen of a place of the stage; and of the centre of a pixel.
ON_SCREEN = """
(() => {
  const x = Math.round(view.x) + (COLUMN + 0.5) * view.zoom, y = Math.round(view.y) + (ROW + 0.5) * view.zoom;
  view.pointed = null;
  view.paint();
  return [...view.context.getImageData(Math.floor(x), Math.floor(y), 1, 1).data].slice(0, 3);
})()
"""


def ball():
    camera = Camera((0, -4, 1), (0, 0, 0), (0, 0, 1), width=WIDTH, height=HEIGHT)
    objects = [
        Object(Sphere((0, 0, 0), 1), Lambertian((0.7, 0.4, 0.2)), "ball"),
        Object(Plane((0, 0, -1), (0, 0, 1)), Lambertian(0.5)),
    ]
    return Scene(camera, objects, environment=GradientSky(0.2, (1, 1.5, 2)))


def color_at(browser, column, row):
    return browser.run(ON_SCREEN.replace("COLUMN", str(column)).replace("ROW", str(row)))


def test_a_page_from_the_first_pass_to_the_last():
    earlier = np.full((HEIGHT, WIDTH, 3), [0.25, 0.0, 1.0], np.float32)
    results = []
    with Browser(1280, 900) as browser:
        with LivePage(title="a <b>ball</b>") as page:
            page.compare_with("old.npz", earlier)

            def work():
                results.append(render(ball(), target_error=1e-9, threads=1, watch=page))

            worker = threading.Thread(target=work)
            worker.start()
            try:
                browser.call("Network.enable")
                browser.open(page.address)
                browser.wait_for(
                    "typeof view !== 'undefined' && view.now && state.errors.length > 1",
                    180,  # kernels may have to be compiled
                )
                _shows_what_is_known(browser)
                _controls_do_what_they_say(browser, earlier)
                _fits_every_screen(browser)
                browser.run("$('stop').click()")
                assert browser.run("$('sure').open") is True
                browser.run("$('yes').click()")
                worker.join(20)
            finally:
                page.ask_to_stop()
                worker.join()
            page.finish("saved as ball.png")
        image, report = results[0].image, results[0].report
        assert report["stopped_by"] == "watcher"
        browser.wait_for(f"isOver && view.now.passes === {report['passes']}")
        assert browser.run("$('phase').textContent") == "Ended: stopped here"
        assert browser.run("$('left').textContent") == "saved as ball.png"
        assert browser.run("$('report').textContent").startswith("  ")
        assert browser.run("$('stop').disabled") is True
        _asks_nothing_any_more(browser)
        _shows_the_picture(browser, image)
        assert browser.complaints == []


def _shows_what_is_known(browser):
    assert browser.run("$('title').textContent") == "a <b>ball</b>"  # as text
    assert browser.run("$('phase').textContent") == "Rendering"
    assert browser.run("$('error-whole').textContent").endswith(" %")
    assert browser.run("document.querySelectorAll('#chart circle').length") >= 4
    counts = browser.run("$('counts').innerText")
    for words in ("rays per second", "camera", "tangent", "rays certified", "peak memory"):
        assert words in counts
    assert "finds every kind of light path" in browser.run("$('missing').innerText")
    assert "the camera has no lens" in browser.run("$('plan-left-out').textContent")


def _controls_do_what_they_say(browser, earlier):
    browser.wait_for("view.earlier !== null")
    browser.run("$('mode').value = 'off'; $('mode').dispatchEvent(new Event('change'))")
    browser.run("$('exact').click()")
    assert browser.run("[view.zoom, $('zoom').textContent]")[0] == 1
    browser.run("$('fit').click()")
    assert browser.run("Number.isInteger(view.zoom) && view.zoom > 8")

    # A pointer that rests asks for what lies under it.
    x, y = browser.run(
        "(() => { const box = $('stage').getBoundingClientRect();"
        f"return [box.left + view.x + {WIDTH / 2} * view.zoom, box.top + view.y + {HEIGHT / 2} * view.zoom]; }})()"
    )
    browser.call("Input.dispatchMouseEvent", type="mouseMoved", x=x + 1, y=y + 1)
    found = browser.wait_for("$('probe').innerText.includes('(proven)') && $('probe').innerText")
    assert f"(column {WIDTH // 2}, row {HEIGHT // 2})" == browser.run(
        "$('probe-place').textContent"
    )
    for words in ("(95 %)", "ball", "Sphere", "Lambertian, colour (0.7, 0.4, 0.2)", "normal"):
        assert words in found

    # The same with keys.
    browser.run("$('stage').focus()")
    browser.call("Input.dispatchKeyEvent", type="keyDown", key="ArrowRight")
    browser.wait_for(f"view.pointed.column === {WIDTH // 2 + 1}")

    # Exposure acts on radiance, on the page alone: what was clipped comes back.
    sky = screen_pixels(earlier * 0.25)[0, 0].tolist()
    browser.run("$('mode').value = 'panes'; $('mode').dispatchEvent(new Event('change'))")
    browser.run("$('exposure').value = -2; $('exposure').dispatchEvent(new Event('input'))")
    assert color_at(browser, 5, 5) == sky  # the pane on the left
    assert browser.run("$('stops').textContent").endswith("2.0 stops")
    browser.run("$('mode').value = 'slider'; $('mode').dispatchEvent(new Event('change'))")
    browser.run("$('divider').value = 100; $('divider').dispatchEvent(new Event('input'))")
    assert color_at(browser, 30, 20) == sky
    browser.run("$('mode').value = 'off'; $('mode').dispatchEvent(new Event('change'))")
    browser.run("$('expose-zero').click()")

    # A PNG from the file dialog, and one that does not fit.
    browser.run(
        "(async () => { for (const [width, name] of [[48, 'png'], [5, 'small.png']]) {"
        "const canvas = new OffscreenCanvas(width, 32), context = canvas.getContext('2d');"
        "context.fillStyle = 'rgb(10, 200, 30)'; context.fillRect(0, 0, width, 32);"
        "compare(await Picture.ofFile(await canvas.convertToBlob()), name); } })()"
    )
    passes = browser.run("state.passes")
    browser.wait_for(f"state.passes > {passes}")  # what is new of the render does not hide it
    assert "small.png is 5" in browser.run("$('notice').textContent")
    browser.run("$('mode').value = 'slider'; $('mode').dispatchEvent(new Event('change'))")
    assert color_at(browser, 5, 5) == [10, 200, 30]
    browser.run("$('mode').value = 'off'; $('mode').dispatchEvent(new Event('change'))")


def _fits_every_screen(browser):
    for width in (1920, 1000, 400, 320):
        browser.resize(width, 900)
        assert browser.run("document.documentElement.scrollWidth") <= width
        # No two controls lie over each other, and every one has a name.
        overlaps = browser.run(
            "(() => { const boxes = [...document.querySelectorAll('header > *, .tools button, .tools input,"
            " .tools output, .tools .button, .card')].filter((e) => e.offsetParent && !e.classList.contains('unseen'))"
            ".map((e) => [e.id || e.className, e.getBoundingClientRect()]); const found = [];"
            "boxes.forEach(([a, p], i) => boxes.slice(i + 1).forEach(([b, q]) => {"
            "if (p.left < q.right - 1 && q.left < p.right - 1 && p.top < q.bottom - 1 && q.top < p.bottom - 1)"
            " found.push(`${width = window.innerWidth}: ${a} over ${b}`); })); return found; })()"
        )
        assert overlaps == []
    browser.resize(1280, 900)
    tree = browser.call("Accessibility.getFullAXTree")["nodes"]
    named = ("button", "slider", "combobox", "progressbar", "spinbutton", "img", "application")
    for node in tree:
        if node.get("role", {}).get("value") in named and not node.get("ignored"):
            assert node.get("name", {}).get("value"), node


def _asks_nothing_any_more(browser):
    before = sum(event["method"] == "Network.requestWillBeSent" for event in browser.events)
    time.sleep(1.2)
    browser.run("ask({ column: 3, row: 3 }, 0)")
    browser.wait_for("$('probe').innerText.includes('the render has ended')")
    asked = [
        e["params"]["request"]["url"]
        for e in browser.events
        if e["method"] == "Network.requestWillBeSent"
    ]
    assert len(asked) == before
    # Nor did it ever ask anybody else.
    assert {url.split("/")[2].split(":")[0] for url in asked if url.startswith("http")} == {
        "127.0.0.1"
    }


def _shows_the_picture(browser, image):
    """What is on the screen is what a .png of the result holds, up to the digits of half precision."""
    expected = screen_pixels(image)
    for column, row in ((0, 0), (24, 16), (47, 31), (10, 25)):
        shown = np.array(color_at(browser, column, row))
        assert np.abs(shown - expected[row, column]).max() <= 1
