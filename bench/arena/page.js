"use strict";
const ledger = JSON.parse(document.getElementById("data").textContent);
ledger.entries = ledger.entries.map(values => Object.fromEntries(ledger.entry_columns.map((name, i) => [name, values[i]])));
const setOf = new Map(ledger.sets.map(one => [one.name, one]));
const families = [...new Set(ledger.sets.map(one => one.family))];
const laws = [...new Set(ledger.sets.map(one => one.law))];
// A hue for each maker, a dash for each of its solvers; both are seen on light and on dark ground.
const hues = ["#2f7ed8", "#e07b00", "#2a9d4a", "#d6404e", "#9a60d6", "#0fa3a3", "#c9539b", "#8c8c2b", "#7f8a96"];
const dashes = ["", "7 3", "2 3", "10 3 2 3", "4 4", "12 4", "1 5", "8 3 2 3 2 3", "14 3 3 3", "5 2"];
const makerOf = name => name.split(" ")[0];
const makers = [...new Set(ledger.solvers.map(one => makerOf(one.name)))];
const styleOf = new Map();
for (const maker of makers) {
  ledger.solvers.filter(one => makerOf(one.name) === maker).forEach((one, i) => styleOf.set(
    one.name, {hue: hues[makers.indexOf(maker) % hues.length], dash: dashes[i % dashes.length]}));
}
let order = {column: "set", down: false};

const element = (tag, text, attributes = {}) => {
  const made = document.createElement(tag);
  made.textContent = text;
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
};
const drawn = (tag, attributes, text = "") => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.textContent = text;
  return made;
};
const short = value => value === null || value === undefined ? "–" : value === 0 ? "0" :
  value >= 1e5 || value < 1e-2 ? value.toExponential(1) : value >= 100 ? Math.round(value).toString() : value.toPrecision(3);
const residual = value => value === null ? "not finite" : value === 0 ? "0" : value.toExponential(1);
const middle = values => values.length ? [...values].sort((a, b) => a - b)[Math.ceil(values.length / 2) - 1] : null;

function boxes(place, names, type) {
  names.forEach((name, i) => {
    const box = Object.assign(document.createElement("input"), {type, name: place, value: name, checked: type === "checkbox" || !i});
    const label = document.createElement("label");
    label.append(box, " " + (place === "tolerances" ? Number(name).toExponential(0) : name));
    document.getElementById(place).append(label);
  });
}
const ticked = place => new Set([...document.querySelectorAll(`#${place} input:checked`)].map(box => box.value));

/** What the filters leave: sets, solvers, and for each solver its entries by set. */
function selection() {
  const tolerance = Number([...ticked("tolerances")][0]), ofFamilies = ticked("families"), ofLaws = ticked("laws");
  const sets = ledger.sets.filter(one => ofFamilies.has(one.family) && ofLaws.has(one.law)).map(one => one.name);
  const inSets = new Set(sets), chosen = ticked("solvers"), bySolver = new Map();
  for (const one of ledger.solvers) if (chosen.has(one.name)) bySolver.set(one.name, new Map());
  for (const entry of ledger.entries) {
    if (entry.tolerance === tolerance && inSets.has(entry.set) && bySolver.has(entry.solver)) {
      bySolver.get(entry.solver).set(entry.set, entry);
    }
  }
  return {tolerance, sets, bySolver};
}
/** Microseconds for a solved environment: the set's time over how many were solved. */
const cost = entry => entry.us === null || !entry.solved ? Infinity : entry.us * setOf.get(entry.set).environments / entry.solved;

function fastest({sets, bySolver}) {
  const found = new Map(sets.map(name => [name, Infinity]));
  for (const own of bySolver.values()) for (const [name, entry] of own) found.set(name, Math.min(found.get(name), cost(entry)));
  return found;
}

function standing(selected, best) {
  const rows = [];
  for (const [solver, own] of selected.bySolver) {
    const entries = [...own.values()];
    if (!entries.length) continue;
    const sum = read => entries.reduce((total, entry) => total + read(entry), 0);
    const says = entries.filter(entry => entry.claimed !== null);
    const same = name => {
      const compared = entries.filter(entry => entry[name] !== null);
      return compared.length ? [compared.filter(entry => entry[name]).length, compared.length] : null;
    };
    const all = sum(entry => setOf.get(entry.set).environments), solved = sum(entry => entry.solved);
    rows.push({solver, sets: entries.length, solved, all, share: solved / all,
      lies: says.length ? says.reduce((total, entry) => total + entry.false_claims, 0) : null,
      slower: middle(entries.filter(entry => cost(entry) < Infinity).map(entry => cost(entry) / best.get(entry.set))),
      memory: Math.max(...entries.map(entry => entry.memory_mib ?? -1)), permuted: same("permuted_equal"), threads: same("threads_equal"),
      machines: same("machines_equal")});
  }
  rows.sort((a, b) => b.share - a.share || b.sets - a.sets);
  const table = document.getElementById("standing");
  table.replaceChildren(heads(["solver", "sets", "environments solved", "share", "false claims", "slower than the fastest",
    "memory, most [MiB]", "same bits, permuted", "same bits, 2 threads", "same bits, machines"], 1));
  for (const row of rows) {
    const line = document.createElement("tr");
    const name = element("td", "", {class: "name"});
    name.append(swatch(row.solver), row.solver);
    line.append(name, cell(row.sets), cell(`${row.solved} of ${row.all}`), cell(`${(100 * row.share).toFixed(1)} %`),
      cell(row.lies === null ? "–" : row.lies, row.lies ? "bad" : ""), cell(row.slower === null ? "–" : short(row.slower)),
      cell(row.memory < 0 ? "–" : short(row.memory)), bits(row.permuted), bits(row.threads), bits(row.machines));
    line.addEventListener("mouseenter", () => alone(row.solver));
    line.addEventListener("mouseleave", () => alone(null));
    table.append(line);
  }
}
const cell = (text, kind = "") => element("td", text, {class: `number ${kind}`});
const bits = pair => pair ? cell(`${pair[0]} of ${pair[1]}`, pair[0] < pair[1] ? "bad" : "good") : cell("–");
function heads(names, left) {
  const line = document.createElement("tr");
  names.forEach((name, i) => line.append(element("th", name, {class: i < left ? "" : "number"})));
  return line;
}
function swatch(solver) {
  const style = styleOf.get(solver), picture = drawn("svg", {class: "swatch", viewBox: "0 0 34 10", "aria-hidden": "true"});
  picture.append(drawn("line", {x1: 0, x2: 34, y1: 5, y2: 5, stroke: style.hue, "stroke-width": 3, "stroke-dasharray": style.dash}));
  return picture;
}

const frame = {left: 50, right: 845, top: 12, bottom: 370, most: 1000};
const across = times => frame.left + (frame.right - frame.left) * Math.log(times) / Math.log(frame.most);
const upward = share => frame.bottom - (frame.bottom - frame.top) * share;
function profile(selected, best) {
  const picture = document.getElementById("profile");
  picture.replaceChildren();
  for (const share of [0, 0.25, 0.5, 0.75, 1]) {
    picture.append(drawn("path", {class: "grid", d: `M${frame.left} ${upward(share)}H${frame.right}`}),
      drawn("text", {x: frame.left - 8, y: upward(share) + 4, "text-anchor": "end"}, `${100 * share} %`));
  }
  for (const times of [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000]) {
    picture.append(drawn("path", {class: "grid", d: `M${across(times)} ${frame.top}V${frame.bottom}`}),
      drawn("text", {x: across(times), y: frame.bottom + 18, "text-anchor": "middle"}, times));
  }
  picture.append(drawn("text", {x: (frame.left + frame.right) / 2, y: frame.bottom + 40, "text-anchor": "middle"},
    "times the time of the fastest solver of the set"));
  for (const [solver, own] of selected.bySolver) {
    if (!own.size) continue;
    const steps = [...own.values()].filter(entry => cost(entry) < Infinity).map(entry => [
      Math.max(1, cost(entry) / best.get(entry.set)), entry.solved / setOf.get(entry.set).environments / own.size]).sort((a, b) => a[0] - b[0]);
    let share = 0, path = `M${across(1)} ${upward(0)}`;
    for (const [times, more] of steps) {
      if (times > frame.most) break;
      path += `H${across(times).toFixed(1)}V${upward(share += more).toFixed(1)}`;
    }
    const style = styleOf.get(solver);
    const curve = drawn("path", {class: "curve", d: `${path}H${frame.right}`, stroke: style.hue, "stroke-dasharray": style.dash, "data-solver": solver});
    curve.append(drawn("title", {}, solver));
    curve.addEventListener("mouseenter", () => alone(solver));
    curve.addEventListener("mouseleave", () => alone(null));
    picture.append(curve);
  }
}
function alone(solver) {
  document.getElementById("profile").classList.toggle("alone", solver !== null);
  for (const curve of document.querySelectorAll("#profile .curve")) curve.classList.toggle("chosen", curve.dataset.solver === solver);
}

const columns = [["set", "set"], ["solver", "solver"], ["solved", "solved"], ["residual_max", "residual, most"],
  ["residual_p95", "residual, p95"], ["false_claims", "false claims"], ["us", "µs an environment"], ["iterations", "iterations"],
  ["memory_mib", "memory [MiB]"], ["permuted_equal", "permuted"], ["threads_equal", "2 threads"], ["machines_equal", "machines"],
  ["hash", "hash"], ["note", "note"]];
function runs(selected) {
  const entries = [...selected.bySolver.values()].flatMap(own => [...own.values()]);
  const key = entry => entry[order.column] ?? (order.column.startsWith("residual") ? Infinity : -1);
  entries.sort((a, b) => (key(a) < key(b) ? -1 : key(a) > key(b) ? 1 : 0) * (order.down ? -1 : 1));
  const table = document.getElementById("runs"), line = document.createElement("tr");
  columns.forEach(([name, title], i) => {
    const head = element("th", "", {class: i < 2 || i > 11 ? "" : "number"}), button = element("button", title, {type: "button"});
    button.addEventListener("click", () => { order = {column: name, down: order.column === name && !order.down}; show(); });
    head.append(button, order.column === name ? order.down ? " ↓" : " ↑" : "");
    line.append(head);
  });
  table.replaceChildren(line);
  const same = value => value === null ? cell("–") : cell(value ? "same" : "other", value ? "good" : "bad");
  for (const entry of entries) {
    const row = document.createElement("tr"), all = setOf.get(entry.set).environments;
    row.append(element("td", entry.set, {class: "name"}), element("td", entry.solver, {class: "name"}),
      cell(`${entry.solved} of ${all}`, entry.solved < all ? "bad" : ""), cell(residual(entry.residual_max)), cell(residual(entry.residual_p95)),
      cell(entry.false_claims ?? "–", entry.false_claims ? "bad" : ""), cell(short(entry.us)), cell(entry.iterations ?? "–"),
      cell(short(entry.memory_mib)), same(entry.permuted_equal), same(entry.threads_equal), same(entry.machines_equal), element("td", entry.hash, {class: "hash"}),
      element("td", entry.note));
    table.append(row);
  }
}

function show() {
  const selected = selection(), best = fastest(selected);
  const environments = selected.sets.reduce((total, name) => total + setOf.get(name).environments, 0);
  document.getElementById("count").textContent =
    `Sets: ${selected.sets.length}. Environments: ${environments}. To ${selected.tolerance.toExponential(0)}.`;
  standing(selected, best);
  profile(selected, best);
  runs(selected);
}
boxes("tolerances", ledger.tolerances.map(String), "radio");
boxes("laws", laws, "checkbox");
boxes("families", families, "checkbox");
boxes("solvers", ledger.solvers.map(one => one.name), "checkbox");
document.getElementById("filters").addEventListener("change", show);
for (const button of document.querySelectorAll("legend button")) {
  button.addEventListener("click", () => {
    for (const box of document.querySelectorAll(`#${button.dataset.all ?? button.dataset.none} input`)) box.checked = "all" in button.dataset;
    show();
  });
}
show();
