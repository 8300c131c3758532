"use strict";
// The pixel that is asked about: its value, and what its ray meets.

let probeTimer = 0, isProbing = false, wanted = null;
function ask(pixel, delay = 90) {
  view.point(pixel);
  if (!pixel) return;
  setText("probe-place", `(column ${pixel.column}, row ${pixel.row})`);
  wanted = pixel;
  clearTimeout(probeTimer);
  probeTimer = setTimeout(probe, delay);
}

async function probe() {
  if (isProbing || !wanted) return;
  const pixel = wanted;
  wanted = null;
  isProbing = true;
  let found = null;
  try {
    if (!isOver) {
      const answer = await fetch(address("probe", pixel));
      if (answer.ok) found = await answer.json();
    }
  } catch {
    // What the page itself holds is shown instead.
  } finally {
    isProbing = false;
  }
  if (view.pointed?.column === pixel.column && view.pointed?.row === pixel.row) showProbe(pixel, found);
  if (wanted) probe();
}

function showProbe(pixel, found) {
  const table = document.createElement("table"), body = table.createTBody();
  $("probe-hint").hidden = true;
  const value = found?.value ?? view.now?.at(pixel.column, pixel.row) ?? null;
  if (value) {
    body.append(headRow(found ? `Radiance after ${many(found.passes)} passes` : "Radiance (three digits)", 2));
    ["red", "green", "blue"].forEach((name, i) => {
      const label = document.createElement("span"), swatch = document.createElement("span");
      swatch.className = `swatch ${name[0]}`;
      label.append(swatch, name);
      const half = found?.half_interval[i];
      const text = number(value[i], found ? 5 : 3);
      body.append(row(label, half === null || half === undefined ? text : `${text} ± ${number(half, 2)} (95 %)`));
    });
  }
  if (found?.hit) {
    const hit = found.hit;
    body.append(headRow("The ray through its centre meets", 2));
    body.append(row("object", hit.object), row("surface", hit.surface), row("material", hit.material));
    body.append(row("distance t", `${number(hit.t, 15)}${hit.t_bound === null ? "" : ` ± ${number(hit.t_bound, 2)} (proven)`}`));
    body.append(row("position", vector(hit.position)), row("normal", vector(hit.normal)));
    body.append(row("u, v, patch", `${number(hit.uv[0], 5)}, ${number(hit.uv[1], 5)}, ${hit.patch}`));
    if (hit.tangent) body.append(row("note", "decided within rounding (tangent)"));
    if (!hit.front) body.append(row("seen", "from behind"));
  } else if (found) body.append(headRow("The ray through its centre meets nothing", 2));
  else if (isOver) body.append(row("note", "the render has ended: no ray is traced any more"));
  $("probe").replaceChildren(table);
}
