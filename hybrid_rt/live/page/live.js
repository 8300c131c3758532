"use strict";
// Hears of the render by server-sent events, and shows it. The last script: it begins.

let about = {}, state = { phase: "preparing" }, events = null, attempts = 0;
let isFetching = false, isOver = false;

// --- what does not change

function showAbout() {
  document.title = `${about.title} – hybrid_rt`;
  $("title").textContent = about.title || "Render";
  const settings = about.settings;
  if (!settings) return;
  $("subtitle").textContent =
    `${settings.integrator}, ${about.width} × ${about.height} pixels, seed ${settings.seed}, ` +
    `${about.threads} thread${about.threads === 1 ? "" : "s"}`;
  const box = $("missing");
  box.replaceChildren();
  for (const sentence of about.left_out) box.append(paragraph(`${settings.integrator} does not find ${sentence}`));
  if (!about.left_out.length)
    box.append(paragraph(`${settings.integrator} finds every kind of light path of this scene, up to ${settings.max_depth} bounces.`));
  else if (about.unfound && about.unfound.why_unknown)
    box.append(paragraph(`Its size is not known: ${about.unfound.why_unknown}.`, "small"));
  else if (about.unfound)
    box.append(paragraph(
      `The image mean lacks ${number(about.unfound.mean, 3)} ± ${number(about.unfound.half_interval_95, 1)} of it (95 %), ` +
      `measured by ${many(about.unfound.photons)} photons where the camera sees matt surfaces directly.`, "small"));
  else box.append(paragraph("Its size is not measured.", "small"));
  if (about.has_photons) box.append(paragraph(
    about.blur_stays ? "Photons blur the light a little; more passes do not lessen that." : "Photons blur the light a little; more passes lessen that.", "small"));
  for (const [id, kind] of [["plan-left-out", "left_out"], ["plan-used", "used"]]) {
    $(id).replaceChildren(...Object.values(about.plan).flatMap((part) => Object.entries(part[kind])).flatMap(([name, why]) => {
      const term = document.createElement("dt"), reason = document.createElement("dd");
      term.textContent = name;
      reason.textContent = why;
      return [term, reason];
    }));
  }
  const power = about.error_power / 2;
  $("guide-note").textContent = `expected: as passes to the power −${number(power, 2)}`;
  if (about.compared && !view.earlier) fetchCompared();
}

// --- what changes

const PHASES = {
  preparing: "Preparing", rendering: "Rendering", done: "Done, saving", ended: "Ended", failed: "Failed",
};
const REASONS = {
  passes: "all passes are made", time_budget: "the time is up", target_error: "the target error is reached",
  target_error_trimmed: "the target error of most pixels is reached", interrupted: "ended by Ctrl-C",
  watcher: "stopped here", blur: "the blur keeps the target out of reach", not_finite: "some pixels are not finite",
  cluster_lost: "the cluster was lost",
  contradicted: "photons find light that the target error does not count",
};

function showState() {
  document.body.dataset.phase = state.phase;
  const reason = REASONS[state.stopped_by];
  let phase = PHASES[state.phase] ?? state.phase;
  if (state.phase === "rendering" && state.stop_asked) phase = "Stopping";
  if (state.phase === "ended") phase = reason ? `Ended: ${reason}` : "Ended without a picture";
  setText("phase", phase);
  const asked = about.settings?.passes;
  setText("passes", !state.passes && state.phase === "preparing" ? "" :
    asked ? `${many(state.passes)} of ${many(asked)} passes` : `${many(state.passes)} pass${state.passes === 1 ? "" : "es"}`);
  const isRendering = state.phase === "rendering", isDone = state.phase === "done" || state.phase === "ended";
  const fraction = isDone && reason ? (asked ? state.passes / asked : 1) : state.fraction;
  $("bar").classList.toggle("unknown", isRendering && fraction === null);
  $("filled").style.width = fraction === null ? "" : `${(100 * Math.min(fraction, 1)).toFixed(1)}%`;
  if (fraction === null) $("bar").removeAttribute("aria-valuenow");
  else $("bar").setAttribute("aria-valuenow", String(Math.round(100 * fraction)));
  setText("gone", state.elapsed !== undefined ? `${span(state.elapsed)} gone` : state.seconds ? `took ${span(state.seconds)}` : "");
  setText("left", isRendering ? (state.seconds_left !== null ? `about ${span(state.seconds_left)} left` : "time left not known yet") : state.words ?? "");
  $("stop").disabled = !["preparing", "rendering"].includes(state.phase) || state.stop_asked || isOver;
  showErrors();
  showCounts();
  if (state.report) {
    $("report-card").hidden = false;
    setText("report", state.report);
  }
  if (isDone || state.phase === "failed") {
    if (!view.now) setText("waiting", "There is no picture.");
  }
}

function setText(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}

let nShown = -1;
function showErrors() {
  const errors = state.errors ?? [];
  if (errors.length === nShown || !errors.length) return;
  nShown = errors.length;
  const last = errors[errors.length - 1];
  setText("error-whole", percent(last.whole));
  setText("error-trimmed", percent(last.trimmed));
  const blur = last.blur > 0 ? ` Of it, blur: ${percent(last.blur)} at most.` : "";
  setText("error-note", `Relative root mean square error, estimated after ${many(last.passes)} passes.${blur}`);
  drawChart($("chart"), errors, about.error_power ?? 1);
}

const KINDS = { hit: "met a surface", miss: "met nothing", tangent: "decided within rounding (tangent)" };
function showCounts() {
  const counts = state.counts;
  if (!counts) return;
  const lines = [headRow("Traced", 2)];
  lines.push(row("rays in all", large(counts.traced)), row("rays per second", large(counts.rays_per_second ?? 0)));
  lines.push(headRow("By kind", 2), ...Object.entries(counts.rays).map(([kind, n]) => row(kind, many(n))));
  lines.push(headRow("First hits", 2), ...["hit", "miss", "tangent"].map((kind) => row(KINDS[kind], many(counts.hits[kind]))));
  lines.push(headRow("Certificate", 2), row("rays certified", many(counts.certified)));
  lines.push(row("first hits changed by it", many(counts.changed)), row("given up", many(counts.given_up)));
  lines.push(headRow("Machine", 2), row("peak memory", `${many(counts.peak_memory_mib)} MiB`));
  $("counts").replaceChildren(...lines);
}

// --- pictures

async function fetchPicture() {
  if (isFetching || !state.passes || state.passes <= (view.now?.passes ?? 0)) return;
  isFetching = true;
  try {
    const answer = await fetch(address("picture", { after: view.now?.passes ?? 0 }));
    if (answer.status === 200) {
      $("waiting").hidden = true;
      view.show(await Picture.ofAnswer(answer));
      if (view.pointed) ask(view.pointed, 0);
    }
  } catch {
    // The next event tries again; a lost connection says so itself.
  } finally {
    isFetching = false;
  }
}

async function fetchCompared() {
  const answer = await fetch(address("compared"));
  if (answer.status === 200) compare(await Picture.ofAnswer(answer), about.compared);
}

function compare(picture, name) {
  const width = view.now?.width ?? about.width, height = view.now?.height ?? about.height;
  if (picture.width !== width || picture.height !== height) {
    notice(`${name} is ${picture.width} × ${picture.height}, this picture ${width} × ${height}: choose one of the same size.`);
    return;
  }
  notice("");
  $("compare-tools").hidden = false;
  if ($("mode").value === "off") $("mode").value = "slider";
  view.showBeside(picture, $("mode").value);
  $("tag-earlier").textContent = `earlier: ${name}`;
  showTags();
}

function showTags() {
  const isShown = view.earlier !== null && view.mode !== "off";
  $("tag-earlier").hidden = $("tag-now").hidden = !isShown;
  $("divider").hidden = !view.hasDivider;
}

// --- the connection

function listen() {
  events = new EventSource(address("events"));
  events.addEventListener("about", (event) => { about = JSON.parse(event.data); showAbout(); });
  events.addEventListener("state", async (event) => {
    attempts = 0;
    state = JSON.parse(event.data);
    showState();
    if (state.phase !== "ended" && state.phase !== "failed") { fetchPicture(); return; }
    // Nothing more comes: take the last picture and hang up for good.
    isOver = true;
    while (isFetching) await new Promise((done) => setTimeout(done, 10));
    await fetchPicture();
    events.close();
    showState();
  });
  events.onerror = () => {
    events.close();
    if (isOver) return;
    attempts += 1;
    if (attempts <= 4) setTimeout(listen, 500 * 2 ** attempts);
    else {
      $("stop").disabled = true;
      setText("phase", "Connection lost");
      $("bar").classList.remove("unknown");
      setText("left", "");
      notice("The render does not answer: it has probably ended. What this page shows is the last it heard.", true);
    }
  };
}

function notice(text, canRetry = false) {
  const box = $("notice");
  if (box.dataset.text === text) return;
  box.dataset.text = text;
  box.hidden = !text;
  box.textContent = text;
  if (canRetry) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = "Try again";
    button.onclick = () => { attempts = 0; notice(""); listen(); };
    box.append(button);
  }
}

expose(0);
listen();
