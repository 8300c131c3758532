"use strict";
// Words, numbers and rows of tables; what all scripts share.

const $ = (id) => document.getElementById(id);
const TOKEN = document.body.dataset.token;
const address = (name, query = {}) => `${name}?${new URLSearchParams({ ...query, token: TOKEN })}`;

const many = (n) => (n === null || n === undefined ? "–" : Math.round(n).toLocaleString("en"));

function percent(share) {
  if (share === null || share === undefined || !Number.isFinite(share)) return "–";
  const value = Number((100 * share).toPrecision(2)), digits = { minimumSignificantDigits: 2, maximumSignificantDigits: 2 };
  if (value === 0) return "0 %";
  return `${value < 1e6 && value >= 1e-3 ? value.toLocaleString("en", digits) : value.toExponential()} %`;
}

const large = (n) => (n >= 1e6 ? `${(n / 1e6).toPrecision(3)} million` : many(n));

function span(seconds) {
  const s = Math.round(seconds);
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min ${s % 60} s`;
  if (s < 100 * 3600) return `${Math.floor(s / 3600)} h ${Math.floor((s % 3600) / 60)} min`;
  return s < 1000 * 86400 ? `${Math.round(s / 86400)} days` : "more than 1000 days";
}

function number(x, digits = 6) {
  if (x === null || x === undefined) return "unknown";
  const short = Number(x.toPrecision(digits));
  const size = Math.abs(short);
  return size !== 0 && (size < 1e-4 || size >= 1e7) ? short.toExponential() : String(short);
}
const vector = (v) => `(${v.map((x) => number(x, 6)).join(", ")})`;

function row(label, ...values) {
  const line = document.createElement("tr"), head = document.createElement("th");
  head.scope = "row";
  head.append(label);
  line.append(head, ...values.map((value) => {
    const cell = document.createElement("td");
    cell.className = "text";
    cell.append(value);
    return cell;
  }));
  return line;
}

function headRow(text, span) {
  const line = document.createElement("tr"), head = document.createElement("th");
  line.className = "head";
  head.colSpan = span;
  head.textContent = text;
  line.append(head);
  return line;
}

function paragraph(text, kind = "") {
  const p = document.createElement("p");
  p.className = kind;
  p.textContent = text;
  return p;
}
