"use strict";
// The estimated error against time, both logarithmic, with the slope that it should have.

const SVG = "http://www.w3.org/2000/svg";

function svgOf(name, attributes, text) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

/** Round numbers within a range: powers of ten, with 2 and 5 where there are few of them. */
function ticksWithin(low, high) {
  const decades = Math.log10(high / low);
  const steps = decades > 3 ? [1] : decades > 1.3 ? [1, 3] : [1, 2, 5];
  const ticks = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power++)
    for (const step of steps) {
      const tick = step * 10 ** power;
      if (tick >= low * 0.999 && tick <= high * 1.001) ticks.push(tick);
    }
  return ticks;
}

const rounded = (x) => String(Number(x.toPrecision(2)));

function timeTick(seconds) {
  if (seconds < 120) return `${rounded(seconds)} s`;
  return seconds < 7200 ? `${rounded(seconds / 60)} min` : `${rounded(seconds / 3600)} h`;
}

/**
 * Draw the chart.
 * place: the element that holds it; errors: [{seconds, whole, trimmed}]; power: the squared error
 * falls as passes to minus this.
 */
function drawChart(place, errors, power) {
  const points = errors.filter((e) => e.seconds > 0 && e.whole > 0);
  place.replaceChildren();
  if (!points.length) return;
  const width = 370, height = 200, left = 46, right = 10, top = 8, bottom = 34;
  const seconds = points.map((e) => e.seconds);
  const values = points.flatMap((e) => [e.whole, e.trimmed]).filter((x) => x > 0);
  const x = scaleOf(Math.min(...seconds), Math.max(...seconds), left, width - right);
  const y = scaleOf(Math.min(...values), Math.max(...values), height - bottom, top);
  const last = points[points.length - 1], first = points[0];
  const words = `Estimated error against time: from ${percent(first.whole)} after ${timeTick(first.seconds)} ` +
    `to ${percent(last.whole)} after ${timeTick(last.seconds)}.`;
  const svg = svgOf("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": words });
  for (const tick of ticksWithin(x.low, x.high)) {
    svg.append(svgOf("line", { class: "grid", x1: x.of(tick), x2: x.of(tick), y1: top, y2: height - bottom }));
    svg.append(svgOf("text", { x: x.of(tick), y: height - bottom + 14, "text-anchor": "middle" }, timeTick(tick)));
  }
  for (const tick of ticksWithin(y.low, y.high)) {
    svg.append(svgOf("line", { class: "grid", y1: y.of(tick), y2: y.of(tick), x1: left, x2: width - right }));
    svg.append(svgOf("text", { x: left - 6, y: y.of(tick) + 4, "text-anchor": "end" }, `${rounded(100 * tick)} %`));
  }
  svg.append(svgOf("line", { class: "axis", x1: left, x2: width - right, y1: height - bottom, y2: height - bottom }));
  svg.append(svgOf("line", { class: "axis", x1: left, x2: left, y1: top, y2: height - bottom }));
  svg.append(svgOf("text", { x: (left + width - right) / 2, y: height - 3, "text-anchor": "middle" }, "time spent on passes"));
  // Through the last estimate of most pixels: where it ought to come from, and where it goes.
  const anchor = last.trimmed > 0 ? last.trimmed : last.whole;
  const guide = (t) => anchor * (t / last.seconds) ** (-power / 2);
  const clip = svgOf("clipPath", { id: "inside" });
  clip.append(svgOf("rect", { x: left, y: top, width: width - left - right, height: height - top - bottom }));
  svg.append(clip);
  svg.append(svgOf("path", {
    class: "guide", "clip-path": "url(#inside)",
    d: `M${x.of(x.low)} ${y.of(guide(x.low))}L${x.of(x.high)} ${y.of(guide(x.high))}`,
  }));
  for (const name of ["trimmed", "whole"]) {
    const shown = points.filter((e) => e[name] > 0);
    const path = shown.map((e, i) => `${i ? "L" : "M"}${x.of(e.seconds).toFixed(1)} ${y.of(e[name]).toFixed(1)}`);
    svg.append(svgOf("path", { class: name, d: path.join("") }));
    for (const e of shown) svg.append(svgOf("circle", { class: name, cx: x.of(e.seconds), cy: y.of(e[name]), r: 2.2 }));
  }
  place.append(svg);
}

/** A logarithmic scale from a little below the lowest to a little above the highest number. */
function scaleOf(lowest, highest, from, to) {
  const least = 2.2;  // so wide at the least, as a factor
  const widen = Math.max(1.12, Math.sqrt(least / Math.max(highest / lowest, 1)));
  const low = lowest / widen, high = highest * widen;
  const of = (value) => from + ((to - from) * Math.log(value / low)) / Math.log(high / low);
  return { low, high, of };
}
