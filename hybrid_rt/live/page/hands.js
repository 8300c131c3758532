"use strict";
// What hands do: pointer, wheel, keys, buttons.

const place = (event) => {
  const box = $("stage").getBoundingClientRect(), density = view.canvas.width / box.width;
  return [(event.clientX - box.left) * density, (event.clientY - box.top) * density];
};
const fingers = new Map();
let isDividing = false, moved = 0, apart = 0;
const isOnDivider = ([x]) => view.hasDivider && Math.abs(x - view.divider * view.canvas.width) < 12 * (window.devicePixelRatio || 1);

function setDivider(share) {
  view.divider = Math.min(Math.max(share, 0), 1);
  $("divider").value = String(Math.round(100 * view.divider));
  view.draw();
}

$("stage").addEventListener("pointerdown", (event) => {
  $("stage").setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, place(event));
  isDividing = fingers.size === 1 && isOnDivider(place(event));
  moved = apart = 0;
});
$("stage").addEventListener("pointermove", (event) => {
  const here = place(event), before = fingers.get(event.pointerId);
  $("stage").classList.toggle("divides", isDividing || isOnDivider(here));
  if (!before) { ask(view.pixelAt(here)); return; }
  fingers.set(event.pointerId, here);
  moved += Math.hypot(here[0] - before[0], here[1] - before[1]);
  if (isDividing) setDivider(here[0] / view.canvas.width);
  else if (fingers.size === 2) {
    const [a, b] = [...fingers.values()], now = Math.hypot(a[0] - b[0], a[1] - b[1]);
    if (!apart) apart = now;
    if (now > 1.3 * apart || now < apart / 1.3) {
      view.zoomBy(now - apart, [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2]);
      apart = now;
    }
  } else if (moved > 4) {
    $("stage").classList.add("dragged");
    view.panBy(here[0] - before[0], here[1] - before[1]);
  }
});
for (const name of ["pointerup", "pointercancel"])
  $("stage").addEventListener(name, (event) => {
    fingers.delete(event.pointerId);
    $("stage").classList.remove("dragged");
    if (!isDividing && moved <= 4) ask(view.pixelAt(place(event)), 0);
    isDividing = false;
  });
let turned = 0;
$("stage").addEventListener("wheel", (event) => {
  event.preventDefault();
  // Pads send many small turns, wheels a few large ones.
  turned += event.deltaMode ? 40 * event.deltaY : event.deltaY;
  if (Math.abs(turned) < 40) return;
  view.zoomBy(-turned, place(event));
  turned = 0;
}, { passive: false });
$("stage").addEventListener("dblclick", (event) => view.zoomBy(1, place(event)));
$("stage").addEventListener("keydown", (event) => {
  if (!view.now || event.ctrlKey || event.metaKey || event.altKey) return;
  const step = event.shiftKey ? 10 : 1;
  const moves = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] };
  const acts = { "+": () => view.zoomBy(1), "=": () => view.zoomBy(1), "-": () => view.zoomBy(-1), 0: () => view.fit(), 1: () => view.zoomTo(1) };
  if (moves[event.key]) {
    const at = view.pointed ?? { column: view.now.width >> 1, row: view.now.height >> 1 };
    ask({
      column: Math.min(Math.max(at.column + moves[event.key][0], 0), view.now.width - 1),
      row: Math.min(Math.max(at.row + moves[event.key][1], 0), view.now.height - 1),
    });
  } else if (acts[event.key]) acts[event.key]();
  else return;
  event.preventDefault();
});

function expose(stops) {
  $("exposure").value = String(stops);
  $("exposure").setAttribute("aria-valuetext", `${stops.toFixed(1)} stops`);
  setText("stops", `${stops > 0 ? "+" : stops < 0 ? "−" : ""}${Math.abs(stops).toFixed(1)} stops`);
  view.expose(stops);
}
$("exposure").addEventListener("input", () => expose(Number($("exposure").value)));
$("expose-zero").addEventListener("click", () => expose(0));
$("zoom-in").addEventListener("click", () => view.zoomBy(1));
$("zoom-out").addEventListener("click", () => view.zoomBy(-1));
$("fit").addEventListener("click", () => view.fit());
$("exact").addEventListener("click", () => view.zoomTo(1));
view.onchange = () => setText("zoom", `${Number((100 * view.zoom).toPrecision(3))} %`);
$("mode").addEventListener("change", () => { view.setMode($("mode").value); showTags(); });
$("divider").addEventListener("input", () => setDivider(Number($("divider").value) / 100));
$("file").addEventListener("change", async () => {
  const file = $("file").files[0];
  if (!file) return;
  try {
    compare(await Picture.ofFile(file), file.name);
  } catch {
    notice(`${file.name} cannot be read as a picture: choose a PNG.`);
  }
  $("file").value = "";
});

$("stop").addEventListener("click", () => $("sure").showModal());
$("go-on").addEventListener("click", () => $("sure").close());
$("yes").addEventListener("click", async () => {
  $("sure").close();
  $("stop").disabled = true;
  try {
    await fetch(address("stop"), { method: "POST" });
  } catch {
    notice("The render does not answer: press Ctrl-C in its terminal.");
  }
});
