"use strict";

// The page of a run. The address after # is the state: filters, q (search), sort, episode (id), step, beside (id).
// Its data come from the server, or lie in the page itself where episodes were exported.
document.addEventListener("DOMContentLoaded", async () => {
  const { $, make, drawn, shape, show, pairs, state, address, ask, reason, help, isField, isPlain } = hijack;
  const FILTERS = { agent: "Agent", task: "Task", corruption: "Corruption", outcome: "Outcome", seed: "Seed" };
  const SEARCHED = ["instruction", "note", "said", "task", "agent", "corruption", "problem"];
  const MOST_EXPORTED = 30;

  // ---- where the data come from ----
  const inside = JSON.parse($("run-data").textContent);
  const isExport = Boolean(inside.episodes);
  const source = isExport
    ? {
        run: async () => inside,
        episode: async (n) => inside.episodes[n],
        check: async (n) => inside.episodes[n].checked,
        picture: (kind, n, step) => inside.pictures[inside.places[`${kind === "strip" ? "seen" : kind}/${n}/${step}`]] || "data:,",
      }
    : {
        run: () => ask("api/run"),
        episode: (n) => ask(`api/episode?number=${n}`),
        check: (n) => ask(`api/check?number=${n}`),
        picture: (kind, n, step) => `${kind}/${n}/${step}`,
      };

  let run;
  try {
    run = await source.run();
  } catch (error) {
    show($("trouble"), error.message);
    return;
  }
  const { ids, texts, numbers } = run;
  const total = ids.length;
  const places = new Map(ids.map((id, n) => [id, n]));
  const text = (name, n) => texts[name].values[texts[name].codes[n]];
  const tokenText = (count) => (count === null || count === undefined ? "" : count < 10000 ? String(count) : `${Math.round(count / 1000)}k`);
  const timeText = (seconds) => {
    if (typeof seconds !== "number") return "";
    if (seconds < 0.1) return `${Math.round(1000 * seconds)} ms`;
    if (seconds < 10) return `${Number(seconds.toFixed(1))} s`;
    if (seconds < 100) return `${Math.round(seconds)} s`;
    return `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")} min`;
  };
  const scoreText = (n) => {
    const outcome = text("outcome", n);
    return outcome === "partial" ? `partial ${Number(numbers.score[n].toFixed(2))}` : outcome;
  };
  const outcomeClass = (outcome) => `outcome ${outcome.replaceAll(" ", "-")}`;
  const outcome = (n, words = scoreText(n)) => make("span", { class: outcomeClass(text("outcome", n)) }, words);

  // ---- which episodes match ----
  const lowered = Object.fromEntries(SEARCHED.map((name) => [name, texts[name].values.map((value) => value.toLowerCase())]));
  const loweredIds = ids.map((id) => id.toLowerCase());
  const searched = (words) => {
    const wanted = words.trim().toLowerCase();
    if (!wanted) return null;
    const hits = SEARCHED.map((name) => [texts[name].codes, lowered[name].map((value) => value.includes(wanted))]);
    return loweredIds.map((id, n) => id.includes(wanted) || hits.some(([codes, has]) => has[codes[n]]));
  };
  const filterOf = (wanted, name) => {
    if (!wanted[name]) return null;
    const code = texts[name].values.indexOf(wanted[name]);
    return texts[name].codes.map((found) => found === code);
  };
  const SORTS = {
    outcome: (n) => texts.outcome.codes[n],
    task: (n) => text("task", n),
    corruption: (n) => texts.corruption.codes[n],
    agent: (n) => texts.agent.codes[n],
    steps: (n) => numbers.steps[n] ?? -1,
    tokens: (n) => numbers.tokens[n] ?? -1,
    time: (n) => numbers.seconds[n] ?? -1,
  };
  const matching = (wanted) => {
    const masks = [...Object.keys(FILTERS).map((name) => filterOf(wanted, name)), searched(wanted.q || "")].filter(Boolean);
    const found = [];
    for (let n = 0; n < total; n++) if (masks.every((mask) => mask[n])) found.push(n);
    const [, down, by] = /^(-?)(.*)$/.exec(wanted.sort || "");
    const key = SORTS[by];
    if (!key) return found;
    const keys = new Map(found.map((n) => [n, key(n)]));
    const way = down ? -1 : 1;
    return found.sort((a, b) => (keys.get(a) < keys.get(b) ? -way : keys.get(a) > keys.get(b) ? way : a - b));
  };
  let kept = { asked: null, found: [] };
  const matches = (wanted) => {
    const asked = JSON.stringify([...Object.keys(FILTERS), "q", "sort"].map((name) => wanted[name] || ""));
    if (kept.asked !== asked) kept = { asked, found: matching(wanted) };
    return kept.found;
  };

  // ---- the address ----
  let seeking = false; // the search is wanted once the list stands
  const go = (changes, replace = false) => {
    if (!replace) location.hash = address(changes);
    else {
      history.replaceState(null, "", address(changes));
      render();
    }
  };
  const toEpisode = (n, changes = {}) => address({ episode: ids[n], ...changes });

  // ---- the table ----
  // The last attempt at a case counts, as in the report.
  const cells = () => {
    const last = new Map();
    const names = ["agent", "corruption", "task", "seed"];
    for (let n = 0; n < total; n++) last.set(names.map((name) => texts[name].codes[n]).join(), n);
    const found = new Map();
    for (const n of last.values()) {
      const key = `${texts.agent.codes[n]},${texts.corruption.codes[n]}`;
      const cell = found.get(key) || { all: 0, counted: 0, sum: 0 };
      cell.all += 1;
      if (run.counts[n]) {
        cell.counted += 1;
        cell.sum += numbers.score[n] ?? 0;
      }
      found.set(key, cell);
    }
    return found;
  };
  const percent = (share) => (share === 1 || share === 0 ? `${100 * share}` : (100 * share).toFixed(share > 0.995 || share < 0.005 ? 1 : 0));
  const table = cells();
  let drawnBoard = "";
  const narrow = window.matchMedia("(max-width: 40rem)");
  const drawBoard = (wanted) => {
    const asked = `${narrow.matches} ${wanted.agent} ${wanted.corruption}`;
    if (asked === drawnBoard) return;
    drawnBoard = asked;
    const [down, across] = narrow.matches ? ["corruption", "agent"] : ["agent", "corruption"];
    const jump = (changes) => address({ agent: "", corruption: "", episode: "", step: "", beside: "", ...changes });
    const broken = (value) => value.split(/(?<=_)/).flatMap((word) => [word, make("wbr")]); // long names break at _
    const head = (name, value) => make("th", { scope: name === down ? "row" : "col", title: value }, make("a", { href: jump({ [name]: value }) }, ...broken(value || "?")));
    const cell = (row, column) => {
      const codes = { [down]: row, [across]: column };
      const found = table.get(`${codes.agent},${codes.corruption}`);
      if (!found) return make("td");
      const [agent, corruption] = [texts.agent.values[codes.agent], texts.corruption.values[codes.corruption]];
      const share = found.counted ? found.sum / found.counted : null;
      const words = share === null ? "–" : `${percent(share)} %`;
      const link = make("a", { href: jump({ agent, corruption }), "aria-label": `${agent}, ${corruption}: ${words}, ${found.counted} of ${found.all} count` }, words, make("small", {}, String(found.counted)));
      link.style.setProperty("--s", String(share ?? 0));
      if (wanted.agent === agent && wanted.corruption === corruption) link.setAttribute("aria-current", "true");
      return make("td", {}, link);
    };
    const columns = texts[across].values;
    const rows = texts[down].values.map((value, row) => make("tr", {}, head(down, value), ...columns.map((_, column) => cell(row, column))));
    const corner = make("th", { title: "mean score of the episodes that count, in percent, and how many" }, run.scored ? "right, %" : "success, %");
    $("table").replaceChildren(make("thead", {}, make("tr", {}, corner, ...columns.map((value) => head(across, value)))), make("tbody", {}, ...rows));
  };

  // ---- the filters ----
  const filters = $("filters");
  for (const [name, label] of Object.entries(FILTERS)) {
    if (name === "seed" && texts.seed.values.length > 200) continue; // in scoring runs, steps of recordings
    filters.append(make("label", { class: "field" }, make("span", {}, label), make("select", { name })));
  }
  const fillFilters = (wanted) => {
    const found = searched(wanted.q || "");
    const masks = Object.fromEntries(Object.keys(FILTERS).map((name) => [name, filterOf(wanted, name)]));
    for (const name of Object.keys(FILTERS)) {
      const select = filters.elements[name];
      if (!select) continue;
      const others = Object.entries(masks).filter(([other, mask]) => other !== name && mask).map(([, mask]) => mask);
      if (found) others.push(found);
      const { values, codes } = texts[name];
      const counts = new Array(values.length).fill(0);
      for (let n = 0; n < total; n++) if (others.every((mask) => mask[n])) counts[codes[n]] += 1;
      const options = values.map((value, code) => [value, counts[code]]).filter(([value, count]) => value && (count || value === wanted[name]));
      select.replaceChildren(make("option", { value: "" }, "all"), ...options.map(([value, count]) => make("option", { value }, `${value} (${count})`)));
      select.value = wanted[name] || "";
      select.classList.toggle("on", Boolean(wanted[name]));
    }
    if (document.activeElement !== filters.elements.q) filters.elements.q.value = wanted.q || "";
  };

  // ---- the list: only the rows in view exist ----
  const list = $("list");
  const chosen = new Set();
  let rows = new Map();
  let listed = [];
  let rowHeight = 40;
  const HEADS = [["", ""], ["outcome", "Outcome"], ["task", "Task"], ["corruption", "Corruption"], ["agent", "Agent"], ["", "Seed"], ["steps", "Steps"], ["tokens", "Tokens"], ["time", "Time"], ["", "Why"]];
  const WIDE = new Set(["Tokens", "Time", "Why", "Seed"]);
  const drawHeads = (wanted) => {
    $("heads").replaceChildren(...HEADS.map(([by, label]) => {
      const kind = `${["Steps", "Tokens", "Time"].includes(label) ? "n " : ""}${WIDE.has(label) ? "wide" : ""}`;
      if (!by) return make("span", { class: kind }, label);
      const sorted = (wanted.sort || "").replace("-", "") === by;
      const down = (wanted.sort || "").startsWith("-");
      const button = make("button", { type: "button", class: kind, "aria-pressed": String(sorted), title: `Sort by ${label.toLowerCase()}` }, label + (sorted ? (down ? " ↓" : " ↑") : ""));
      button.addEventListener("click", () => go({ sort: sorted ? (down ? "" : `-${by}`) : by }, true));
      return button;
    }));
  };
  const row = (place) => {
    const n = listed[place];
    const box = make("input", { type: "checkbox", "aria-label": `Choose ${ids[n]}` });
    box.checked = chosen.has(n);
    box.addEventListener("change", () => choose([n], box.checked));
    const problem = text("problem", n);
    const note = problem || text("note", n);
    const link = make("a", { href: toEpisode(n), title: ids[n] },
      make("span", { class: "gap" }),
      outcome(n),
      make("span", { class: "task" }, text("task", n) || ids[n]),
      make("span", { class: "label", "data-seed": text("seed", n) }, text("corruption", n)),
      make("span", { class: "who" }, text("agent", n)),
      make("span", { class: "soft wide" }, text("seed", n) + (numbers.attempt[n] ? ` #${numbers.attempt[n] + 1}` : "")),
      make("span", { class: "n" }, String(numbers.steps[n] ?? "")),
      make("span", { class: "n soft wide" }, tokenText(numbers.tokens[n])),
      make("span", { class: "n soft wide" }, timeText(numbers.seconds[n])),
      make("span", { class: problem ? "damaged wide" : "soft wide" }, note));
    const item = make("li", { "aria-setsize": listed.length, "aria-posinset": place + 1 }, ...(isExport ? [] : [box]), link);
    item.style.transform = `translateY(${place * rowHeight}px)`;
    return item;
  };
  const drawRows = () => {
    if ($("overview").hidden) return;
    const top = list.getBoundingClientRect().top;
    const first = Math.max(0, Math.floor(-top / rowHeight) - 12);
    const end = Math.min(listed.length, Math.ceil((innerHeight - top) / rowHeight) + 12);
    for (const [place, element] of rows) {
      if ((place < first || place >= end) && !element.contains(document.activeElement)) {
        element.remove();
        rows.delete(place);
      }
    }
    for (let place = first; place < end; place++) {
      if (rows.has(place)) continue;
      rows.set(place, row(place));
      list.append(rows.get(place));
    }
  };
  const drawList = (wanted) => {
    listed = matches(wanted);
    rows = new Map();
    list.replaceChildren();
    rowHeight = parseFloat(getComputedStyle(list).getPropertyValue("--row")) * parseFloat(getComputedStyle(document.documentElement).fontSize);
    list.style.height = `${listed.length * rowHeight}px`;
    drawRows();
    drawChosen();
  };
  const focusRow = (place) => {
    if (place < 0 || place >= listed.length) return;
    const top = list.getBoundingClientRect().top + place * rowHeight;
    const bar = $("filters").getBoundingClientRect().height;
    if (top < bar + 10) window.scrollBy(0, top - bar - 10);
    else if (top + rowHeight > innerHeight - 10) window.scrollBy(0, top + rowHeight - innerHeight + 10);
    drawRows();
    rows.get(place)?.querySelector("a").focus({ preventScroll: true });
  };
  const focusedRow = () => {
    for (const [place, element] of rows) if (element.contains(document.activeElement)) return place;
    return -1;
  };

  // ---- chosen episodes ----
  const drawChosen = () => {
    const count = chosen.size;
    $("choose").textContent = count ? "Choose none" : `Choose these ${Math.min(listed.length, MOST_EXPORTED)}`;
    $("choose").hidden = isExport || (!count && !listed.length);
    const link = $("export");
    link.hidden = isExport;
    const can = count > 0 && count <= MOST_EXPORTED;
    link.textContent = count > MOST_EXPORTED ? `${count} chosen: at most ${MOST_EXPORTED} at a time` : count ? `Export ${count}` : "Export";
    link.setAttribute("aria-disabled", String(!can));
    link.title = "One HTML file that opens without a server";
    if (can) link.href = `export?episodes=${[...chosen].sort((a, b) => a - b).join()}`;
    else link.removeAttribute("href");
  };
  const choose = (all, on) => {
    for (const n of all) chosen[on ? "add" : "delete"](n);
    for (const [place, element] of rows) {
      const box = element.querySelector("input");
      if (box) box.checked = chosen.has(listed[place]);
    }
    drawChosen();
  };
  $("choose").addEventListener("click", () => (chosen.size ? choose([...chosen], false) : choose(listed.slice(0, MOST_EXPORTED), true)));

  const showOverview = (wanted) => {
    const last = $("episode").hidden ? null : places.get($("episode").dataset.id);
    $("episode").hidden = true;
    $("overview").hidden = false;
    document.title = `${run.title} – hijack view`;
    drawBoard(wanted);
    fillFilters(wanted);
    drawHeads(wanted);
    drawList(wanted);
    $("count").textContent = listed.length ? `${listed.length.toLocaleString("en")} of ${total.toLocaleString("en")} episodes` : total ? "No episode matches" : "There are no episodes yet";
    $("clear").hidden = ![...Object.keys(FILTERS), "q"].some((name) => wanted[name]);
    $("heads").hidden = !listed.length;
    if (seeking) {
      seeking = false;
      filters.elements.q.focus();
    } else if (last !== null && last !== undefined) {
      window.scrollTo(0, scrolled);
      focusRow(listed.indexOf(last));
    }
  };

  // ---- one episode ----
  const views = [...document.querySelectorAll(".view")];
  const part = (view, selector) => view.querySelector(selector);
  const opened = new Set();
  const known = new Map(); // the last episodes that were read
  let scrolled = 0;
  let shown = null; // what is shown: { main, other, step, last }

  const read = async (n) => {
    if (!known.has(n)) known.set(n, await source.episode(n));
    const data = known.get(n);
    known.delete(n);
    known.set(n, data);
    while (known.size > 8 || text("outcome", known.keys().next().value) === "unfinished" && known.size > 1) known.delete(known.keys().next().value);
    return data;
  };

  const KEYS = { type: "types", hotkey: "presses", key_down: "holds", key_up: "releases", wait: "waits", done: "says DONE", fail: "says FAIL" };
  const LABELS = { double_click: "double", triple_click: "triple", right_click: "right", middle_click: "middle", mouse_down: "down", mouse_up: "up", move: "move" };
  const drawOver = (view, step) => {
    const over = part(view, ".over");
    const frame = part(view, ".frame");
    over.replaceChildren();
    const said = step.strokes.filter((stroke) => KEYS[stroke.type]).map((stroke) => [KEYS[stroke.type], stroke.text ?? (stroke.type === "wait" && stroke.amount ? `${stroke.amount} s` : "")].filter(Boolean).join(" "));
    const word = step.strokes.length ? "" : KEYS[step.action];
    show(part(view, ".typed"), said.join("\n") || word || "");
    const has = { action: step.strokes.length || word, target: step.target, boxes: step.boxes.length };
    for (const box of view.querySelectorAll("[data-layer]")) {
      box.disabled = !step.size || !has[box.dataset.layer];
      box.closest("label").hidden = !has[box.dataset.layer] && box.dataset.layer !== "action";
    }
    if (!step.size) return;
    const [width, height] = step.size;
    over.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const unit = width / (frame.clientWidth || width); // a pixel of the page, in those of the picture
    over.append(drawn("path", { class: "boxes", d: step.boxes.map(([x1, y1, x2, y2]) => `M${x1} ${y1}H${x2}V${y2}H${x1}Z`).join("") }));
    if (step.target) {
      const [x, y, right, bottom] = step.target;
      over.append(...shape("rect", "target", { x, y, width: Math.max(0, right - x), height: Math.max(0, bottom - y) }));
    }
    const pointed = step.strokes.filter((stroke) => stroke.at || stroke.to);
    for (const [k, stroke] of pointed.entries()) {
      over.append(...strokeShapes(stroke, 8 * unit));
      const [x, y] = stroke.at || stroke.to;
      const words = [pointed.length > 1 ? k + 1 : "", LABELS[stroke.type] || ""].filter(Boolean).join(" ");
      if (!words) continue;
      const isRight = x > width - 60 * unit; // inside the picture
      const label = drawn("text", { class: "number", x: x + (isRight ? -13 : 13) * unit, y: Math.max(y - 9 * unit, 15 * unit), "text-anchor": isRight ? "end" : "start" }, words);
      label.style.fontSize = `${13 * unit}px`;
      label.style.strokeWidth = `${3 * unit}px`;
      over.append(label);
    }
  };
  const arrow = (x, y, angle, r) => {
    const at = (turn, long) => `${x + long * Math.cos(angle + turn)} ${y + long * Math.sin(angle + turn)}`;
    return `M${at(0, 0)}L${at(2.7, 1.9 * r)}L${at(-2.7, 1.9 * r)}Z`;
  };
  const strokeShapes = ({ type, at, to, amount }, r) => {
    const found = [];
    const path = (d) => found.push(...shape("path", "action", { d }));
    const circle = ([x, y], size) => found.push(...shape("circle", "action", { cx: x, cy: y, r: size }));
    if (at && to) {
      path(`M${at[0]} ${at[1]}L${to[0]} ${to[1]}`);
      path(arrow(to[0], to[1], Math.atan2(to[1] - at[1], to[0] - at[0]), r));
      circle(at, r * 0.7);
      return found;
    }
    const [x, y] = at || to;
    if (type === "scroll") {
      const way = amount > 0 ? -1 : 1;
      path(`M${x} ${y - way * 2.5 * r}V${y + way * 2.5 * r}`);
      path(arrow(x, y + way * 2.5 * r, (way * Math.PI) / 2, r));
      return found;
    }
    path(`M${x - 2.2 * r} ${y}H${x - r / 2}M${x + r / 2} ${y}H${x + 2.2 * r}M${x} ${y - 2.2 * r}V${y - r / 2}M${x} ${y + r / 2}V${y + 2.2 * r}`);
    if (type !== "move") circle([x, y], r);
    if (["double_click", "triple_click"].includes(type)) circle([x, y], 1.6 * r);
    if (type === "triple_click") circle([x, y], 2.2 * r);
    return found;
  };

  // Where the corruption is not drawn but happened on the machine, the screen before it stands at the left.
  const beforeOf = (n, step, data) => {
    if (!step.no_before) return { src: source.picture("clean", n, step.step), tag: "clean", words: "" };
    if (!step.effects.length) return null;
    const last = data.steps[step.step - 1];
    if (last && !last.lost) return { src: source.picture("seen", n, last.step), tag: `step ${last.step}`, words: "at the left is the step before the effect" };
    const [clean] = sameCase(n, ["agent", "task", "seed"]).filter((other) => text("corruption", other) === "clean" && numbers.steps[other] !== null);
    if (clean === undefined || clean === n || isExport) return null;
    return { src: source.picture("seen", clean, 0), tag: "clean episode", words: "at the left is the first screen of the clean episode" };
  };
  const drawPictures = (view, n, step, data) => {
    const frame = part(view, ".frame");
    const trouble = part(view, ".stage > .trouble");
    const lost = step.lost;
    show(trouble, lost);
    frame.hidden = part(view, ".under").hidden = Boolean(lost);
    view.dataset.place = `${n}/${step.step}`;
    if (lost) return;
    const left = beforeOf(n, step, data);
    frame.classList.toggle("single", !left);
    if (left) part(view, ".tag.left").textContent = left.tag;
    if (step.size) {
      frame.style.setProperty("--w", step.size[0]);
      frame.style.setProperty("--r", step.size[0] / step.size[1]);
    }
    const after = part(view, ".after");
    const before = part(view, ".before");
    const to = source.picture("seen", n, step.step);
    if (after.getAttribute("src") !== to) {
      frame.classList.add("loading");
      after.src = to;
    }
    if (!left) before.removeAttribute("src");
    else if (before.getAttribute("src") !== left.src) before.src = left.src;
    const full = part(view, ".full");
    full.hidden = isExport;
    if (!isExport) full.href = to;
    const size = step.size ? step.size.join("×") : "";
    part(view, ".size").textContent = [size, left ? left.words : step.no_before].filter(Boolean).join(" · ");
  };
  for (const view of views) {
    const frame = part(view, ".frame");
    part(view, ".after").addEventListener("load", () => frame.classList.remove("loading"));
    for (const name of ["after", "before"]) {
      const image = part(view, `.${name}`);
      image.addEventListener("error", async () => {
        const place = view.dataset.place;
        const why = await reason(image.src);
        if (view.dataset.place !== place) return;
        if (name === "after") frame.hidden = part(view, ".under").hidden = true;
        else frame.classList.add("single");
        show(part(view, ".stage > .trouble"), name === "after" ? why : `The clean screen: ${why}`);
      });
    }
    for (const box of view.querySelectorAll("[data-layer]")) {
      box.addEventListener("change", () => {
        if (box.dataset.layer === "boxes") frame.classList.toggle("show-boxes", box.checked);
        else frame.classList.toggle(`hide-${box.dataset.layer}`, !box.checked);
      });
    }
    for (const group of view.querySelectorAll(":scope > details")) {
      group.addEventListener("toggle", () => opened[group.open ? "add" : "delete"](group.className));
    }
  }

  const effectItem = (effect, all) => {
    const item = make("li", {}, make("strong", {}, effect.kind), all ? ` at step ${effect.step}` : "");
    const probe = (found, words) => {
      const say = found.ok ? words : found.problem || `${words}: no`;
      const line = make("span", { class: found.ok ? "probe" : "probe no" }, say);
      if (found.facts) line.title = found.facts;
      return line;
    };
    item.append(...effect.probes.map((found, k) => probe(found, k ? `probed again${found.facts ? `: ${found.facts}` : ""}` : `probed${found.facts ? `: ${found.facts}` : ""}`)));
    if (!effect.probes.length) item.append(make("span", { class: "probe no" }, "no probe was recorded"));
    if (all) {
      item.append(...effect.undone.map((found) => probe(found, "undone")));
      if (effect.did) item.append(make("pre", { tabindex: "0", "aria-label": "What it did" }, effect.did));
    }
    return item;
  };
  const ROLES = { check: "Checked the screen", summarise: "What happened since the last turn (d_t)" };
  const drawText = (view, n, data, step) => {
    const last = data.steps.length - 1;
    const fill = (selector, words) => {
      part(view, selector).hidden = !words;
      return words;
    };
    if (fill(".said", step.said)) part(view, ".words").textContent = step.said;
    const done = step.action || (step.code ? "" : step.step === last ? "None: this is the last screen" : "No action");
    part(view, ".action-words").textContent = done + (step.recorded ? ` (recorded: ${step.recorded})` : "");
    show(part(view, ".code-text"), [step.code, step.ran && `# on the screen, in its own pixels:\n${step.ran}`].filter(Boolean).join("\n"));
    show(part(view, ".refused"), [step.error && `Refused: ${step.error}`, step.result, step.problem].filter(Boolean).join("\n"));
    part(view, ".happened").hidden = !step.effects.length;
    part(view, ".happened .effects").replaceChildren(...step.effects.map((k) => effectItem(data.effects[k], false)));
    part(view, ".watched").hidden = !step.onlooker.length;
    part(view, ".talk").replaceChildren(...step.onlooker.map(([role, words]) => make("p", {}, make("small", {}, ROLES[role] || role), words || "(nothing)")));
    const used = step.usage || {};
    const figures = [
      ["tokens in", used.input_tokens?.toLocaleString("en")],
      ["tokens out", used.output_tokens?.toLocaleString("en")],
      ["model", used.seconds && timeText(used.seconds)],
      ["cost", used.usd && `$${Number(used.usd.toPrecision(3))}`],
      ["screen settled", step.seconds.settle > 0.001 && timeText(step.seconds.settle)],
      ["effects", step.seconds.effects > 0.001 && timeText(step.seconds.effects)],
      ["action", step.seconds.action > 0.001 && timeText(step.seconds.action)],
      ["screen", step.still ? "" : "was still moving"],
    ].filter(([, value]) => value);
    part(view, ".figures").replaceChildren(...pairs(figures));
    const details = [
      [".plan", step.plan], [".all-effects", data.effects.length], [".trace", data.traceback],
      [".step-fields", step.fields.length], [".record-fields", data.fields.length],
    ];
    for (const [selector, has] of details) part(view, selector).hidden = !has;
    part(view, ".plan code").textContent = step.plan;
    part(view, ".all-effects .effects").replaceChildren(...data.effects.map((effect) => effectItem(effect, true)));
    part(view, ".trace code").textContent = data.traceback;
    part(view, ".step-fields dl").replaceChildren(...pairs(step.fields));
    part(view, ".record-fields dl").replaceChildren(...pairs(data.fields));
    for (const group of view.querySelectorAll(":scope > details")) group.open = opened.has(group.className);
  };

  const drawStrip = (view, n, data, now) => {
    const strip = part(view, ".strip ol");
    if (strip.dataset.number !== String(n)) {
      strip.dataset.number = n;
      strip.replaceChildren(...data.steps.map((step) => {
        const small = make("span", { class: "small" });
        if (step.lost) small.append("–");
        else small.append(make("img", { alt: "", loading: "lazy", src: source.picture("strip", n, step.step) }));
        const happened = step.effects.map((k) => data.effects[k].kind);
        if (step.error) happened.push("refused");
        if (step.lost) happened.push("lost");
        const marks = make("span", { class: "marks" }, String(step.step), ...happened.map((word) => make("b", {}, word)));
        return make("li", {}, make("a", { href: "#", "data-step": step.step, "aria-label": `Step ${step.step}${happened.length ? `: ${happened.join(", ")}` : ""}` }, small, marks));
      }));
    }
    for (const link of strip.querySelectorAll("a")) {
      link.href = address({ step: link.dataset.step });
      if (Number(link.dataset.step) !== now) link.removeAttribute("aria-current");
      else {
        link.setAttribute("aria-current", "true");
        const box = part(view, ".strip"); // scrollIntoView would move the page
        box.scrollLeft = link.offsetLeft - box.offsetLeft - (box.clientWidth - link.clientWidth) / 2;
      }
    }
  };
  const drawDamage = (view, data, checked = []) => {
    const all = [...new Set([...data.problems, ...checked])];
    const box = part(view, ".damage");
    box.hidden = !all.length;
    part(view, ".damage h3").textContent = all.length === 1 ? "This episode is damaged" : `This episode is damaged: ${all.length} problems`;
    part(view, ".damage ul").replaceChildren(...all.map((problem) => make("li", {}, problem)));
  };
  const drawView = (view, n, data, wantedStep) => {
    view.hidden = false;
    const isOther = text("corruption", n) !== text("corruption", shown.n);
    part(view, ".who").textContent = [text("agent", n), isOther && text("corruption", n)].filter(Boolean).join(" · ");
    const end = part(view, ".outcome");
    end.className = outcomeClass(text("outcome", n));
    end.textContent = scoreText(n);
    const why = data.problem || data.reason || text("note", n);
    const ended = { max_steps: "ended by the limit of steps", outside: "cut off from outside" }[data.ended];
    const usage = [
      numbers.steps[n] !== null && `${numbers.steps[n]} steps`,
      data.malformed && `${data.malformed} refused`,
      timeText(numbers.seconds[n]),
      numbers.tokens[n] && `${numbers.tokens[n].toLocaleString("en")} tokens`,
      numbers.usd[n] && `$${Number(numbers.usd[n].toPrecision(3))}`,
    ];
    part(view, ".note").textContent = [why, ended, ...usage].filter(Boolean).join(" · ");
    drawDamage(view, data, checks.get(n) || []);
    const sides = part(view, ".sides");
    sides.hidden = !data.steps.length;
    if (!data.steps.length) {
      const record = part(view, ".record-fields");
      for (const group of view.querySelectorAll(":scope > details")) group.hidden = group !== record;
      record.hidden = !data.fields.length;
      record.open = true;
      part(view, ".record-fields dl").replaceChildren(...pairs(data.fields));
      return;
    }
    const step = data.steps[Math.min(wantedStep, data.steps.length - 1)];
    drawPictures(view, n, step, data);
    drawText(view, n, data, step);
    drawOver(view, step);
    drawStrip(view, n, data, step.step);
  };

  // What hijack verify finds in the files is asked for when somebody stays.
  const checks = new Map();
  let waiting;
  const checkLater = (n, current) => {
    clearTimeout(waiting);
    const say = () => {
      if (!current()) return;
      const found = checks.get(n);
      $("checked").className = found?.length === 0 && !run.scored ? "facts ok" : "facts";
      $("checked").textContent = found?.length === 0 && !run.scored && known.get(n)?.steps.length ? "hijack verify finds nothing wrong with the files of this episode" : "";
      if (found?.length) drawDamage(views[0], known.get(n), found);
    };
    say();
    if (checks.has(n)) return;
    waiting = setTimeout(async () => {
      try {
        checks.set(n, await source.check(n));
      } catch {
        return; // the server has ended: the next click says so
      }
      say();
    }, 700);
  };

  const sameCase = (n, fields) => {
    const found = [];
    for (let other = 0; other < total; other++) {
      if (fields.every((name) => texts[name].codes[other] === texts[name].codes[n])) found.push(other);
    }
    return found;
  };
  const drawKin = (n, step) => {
    const group = (label, all, name) => {
      if (all.length < 2) return "";
      const links = all.slice(0, 60).map((other) => {
        const link = make("a", { href: toEpisode(other, { step, beside: "" }), class: outcomeClass(text("outcome", other)), title: ids[other] }, text(name, other) + (numbers.attempt[other] ? ` #${numbers.attempt[other] + 1}` : ""));
        if (other === n) link.setAttribute("aria-current", "true");
        return link;
      });
      return make("div", {}, make("span", {}, label), ...links);
    };
    $("kin").replaceChildren(group("Under", sameCase(n, ["agent", "task", "seed"]), "corruption"), group("By", sameCase(n, ["task", "corruption", "seed"]), "agent"));
  };
  const besides = (n) => {
    const peers = sameCase(n, ["task", "corruption", "seed"]).filter((other) => other !== n);
    const clean = sameCase(n, ["agent", "task", "seed"]).filter((other) => other !== n && text("corruption", other) === "clean");
    return [...peers, ...clean];
  };
  const drawBeside = (n, other) => {
    const all = besides(n);
    if (other !== undefined && !all.includes(other)) all.push(other);
    const option = (one) => make("option", { value: ids[one] }, `${text("agent", one)}${texts.corruption.codes[one] === texts.corruption.codes[n] ? "" : `, ${text("corruption", one)}`} (${text("outcome", one)})`);
    $("beside").replaceChildren(make("option", { value: "" }, "nothing"), ...all.map(option));
    $("beside").value = other === undefined ? "" : ids[other];
    $("beside").closest("label").hidden = !all.length;
  };

  const showEpisode = async (wanted, current) => {
    const n = places.get(wanted.episode);
    if (n === undefined) throw new Error(`There is no episode ${wanted.episode} here.`);
    const other = wanted.beside ? places.get(wanted.beside) : undefined;
    if (wanted.beside && other === undefined) throw new Error(`There is no episode ${wanted.beside} here to set beside it.`);
    const [data, beside] = await Promise.all([read(n), other === undefined ? null : read(other)]);
    if (!current()) return;
    const first = $("episode").hidden;
    if (first) scrolled = $("overview").hidden ? 0 : window.scrollY;
    $("overview").hidden = true;
    $("episode").hidden = false;
    $("episode").dataset.id = ids[n];
    const last = Math.max(0, data.steps.length - 1, beside ? beside.steps.length - 1 : 0);
    const asked = /^\d{1,6}$/.test(wanted.step || "") ? Number(wanted.step) : 0;
    const step = Math.min(asked, last);
    const found = matches(wanted);
    const place = found.indexOf(n);
    shown = { n, other, step, last, back: found[place - 1], next: place < 0 ? found[0] : found[place + 1] };
    $("name").textContent = `${text("task", n) || ids[n]} · ${text("corruption", n)}${text("seed", n) ? ` · seed ${text("seed", n)}` : ""}`;
    show($("instruction"), text("instruction", n));
    $("position").textContent = place < 0 ? "not in the filter" : `${(place + 1).toLocaleString("en")} of ${found.length.toLocaleString("en")}`;
    $("step").textContent = data.steps.length ? `step ${step} of ${last}` : "no steps";
    $("back").disabled = shown.back === undefined;
    $("next").disabled = shown.next === undefined;
    $("step-back").disabled = step <= 0;
    $("step-next").disabled = step >= last;
    drawKin(n, step);
    drawBeside(n, other);
    $("views").classList.toggle("two", Boolean(beside));
    drawView(views[0], n, data, step);
    if (beside) drawView(views[1], other, beside, step);
    else views[1].hidden = true;
    document.title = `${ids[n]} – ${run.title}`;
    checkLater(n, current);
    if (first) {
      window.scrollTo(0, 0);
      $("name").focus({ preventScroll: true });
    }
  };
  window.addEventListener("resize", () => {
    if (shown && !$("episode").hidden) render();
  });

  // ---- buttons and keys ----
  const close = () => go({ episode: "", step: "", beside: "" });
  const move = (n) => n !== undefined && go({ episode: ids[n], step: "", beside: "" });
  const toStep = (step) => step >= 0 && step <= shown.last && go({ step }, true);
  $("close").addEventListener("click", close);
  $("back").addEventListener("click", () => move(shown.back));
  $("next").addEventListener("click", () => move(shown.next));
  $("step-back").addEventListener("click", () => toStep(shown.step - 1));
  $("step-next").addEventListener("click", () => toStep(shown.step + 1));
  $("beside").addEventListener("change", () => go({ beside: $("beside").value }));
  $("clear").addEventListener("click", () => {
    filters.elements.q.value = "";
    location.hash = address({}, { sort: state().sort });
    filters.elements.q.focus();
  });
  let typing;
  filters.addEventListener("submit", (event) => event.preventDefault());
  filters.addEventListener("input", (event) => {
    const { name, value } = event.target;
    clearTimeout(typing);
    if (name === "q") typing = setTimeout(() => go({ q: value.trim() }, true), 120);
    else go({ [name]: value });
  });
  const keys = help([
    ["← →", "previous and next step"],
    ["Shift+← Shift+→", "previous and next episode among those that match"],
    ["Home End", "first and last step"],
    ["b", "flip between the clean screen and what the agent saw"],
    ["c", "another agent's same episode beside it, or nothing"],
    ["Esc", "back to all episodes; on the divider: release it"],
    ["↓ ↑", "in the list: next and previous episode; Enter opens it"],
    ["x", "in the list: choose the episode for the export"],
    ["/", "search"],
    ["?", "this list"],
  ], () => {
    seeking = !$("episode").hidden;
    if (seeking) close();
    else filters.elements.q.focus();
  });
  const flip = () => {
    for (const input of document.querySelectorAll(".view:not([hidden]) .frame input")) {
      input.value = input.value === "100" ? "0" : "100";
      input.dispatchEvent(new Event("input"));
    }
  };
  const beside = () => {
    const [first] = besides(shown.n);
    go({ beside: shown.other === undefined && first !== undefined ? ids[first] : "" });
  };
  const inEpisode = (event) => {
    const episodes = { ArrowLeft: () => move(shown.back), ArrowRight: () => move(shown.next) };
    const steps = {
      ArrowLeft: () => toStep(shown.step - 1),
      ArrowRight: () => toStep(shown.step + 1),
      Home: () => toStep(0),
      End: () => toStep(shown.last),
      Escape: close,
      b: flip,
      c: beside,
    };
    return (event.shiftKey ? episodes : steps)[event.key];
  };
  const inList = (event) => {
    const place = focusedRow();
    const steps = {
      ArrowDown: () => focusRow(place + 1),
      ArrowUp: () => focusRow(place - 1),
      x: () => place >= 0 && !isExport && choose([listed[place]], !chosen.has(listed[place])),
    };
    return steps[event.key];
  };
  document.addEventListener("keydown", (event) => {
    if (keys.open || !isPlain(event)) return;
    if (event.target.matches?.("input[type=range]")) return event.key === "Escape" ? event.target.blur() : undefined;
    if (isField(event.target)) {
      if (event.key === "Escape") event.target.blur();
      return;
    }
    if (event.target.matches?.("pre, .board, .strip") && event.key.startsWith("Arrow")) return;
    const work = $("episode").hidden ? inList(event) : shown && inEpisode(event);
    if (!work) return;
    event.preventDefault();
    work();
  });
  window.addEventListener("scroll", drawRows, { passive: true });
  window.addEventListener("resize", () => {
    if (!$("overview").hidden) showOverview(state());
  });

  // ---- both ----
  let turn = 0;
  const render = async () => {
    const mine = ++turn;
    const current = () => mine === turn;
    const wanted = state();
    try {
      if (wanted.episode === undefined) showOverview(wanted);
      else await showEpisode(wanted, current);
      if (current()) show($("trouble"), "");
    } catch (error) {
      if (!current()) return;
      show($("trouble"), error.message);
      $("trouble").append(" ", make("a", { href: "#" }, "All episodes"));
    }
  };

  $("title").textContent = run.title;
  $("facts").textContent = run.facts;
  if (run.problems.length) {
    $("problems").hidden = false;
    $("problems").open = run.problems.length < 4;
    $("problems").querySelector("summary").textContent = run.problems.length === 1 ? "1 problem of the run" : `${run.problems.length} problems of the run`;
    $("problems").querySelector("ul").append(...run.problems.map((problem) => make("li", {}, problem)));
  }
  window.addEventListener("hashchange", render);
  render();
});
