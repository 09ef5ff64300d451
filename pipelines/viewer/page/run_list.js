"use strict";

// The list of episodes, of which only the rows in view exist, and those that are chosen for an export.
// `go` changes the address.
hijack.runList = (data, go) => {
  const { $, make } = hijack;
  const { isExport, ids, numbers, text, tokenText, timeText, outcome, matches, toEpisode } = data;
  const MAX_EXPORTED = 30;

  const list = $("list");
  const selection = new Set();
  let rows = new Map();
  let episodes = [];
  let rowHeight = 40;
  const HEADS = [["", ""], ["outcome", "Outcome"], ["task", "Task"], ["corruption", "Corruption"], ["agent", "Agent"], ["", "Seed"], ["steps", "Steps"], ["tokens", "Tokens"], ["time", "Time"], ["", "Why"]];
  const WIDE = new Set(["Tokens", "Time", "Why", "Seed"]);
  const drawHeads = (fragment) => {
    $("heads").replaceChildren(...HEADS.map(([by, label]) => {
      const kind = `${["Steps", "Tokens", "Time"].includes(label) ? "n " : ""}${WIDE.has(label) ? "wide" : ""}`;
      if (!by) return make("span", { class: kind }, label);
      const sorted = (fragment.sort || "").replace("-", "") === by;
      const down = (fragment.sort || "").startsWith("-");
      const button = make("button", { type: "button", class: kind, "aria-pressed": String(sorted), title: `Sort by ${label.toLowerCase()}` }, label + (sorted ? (down ? " ↓" : " ↑") : ""));
      button.addEventListener("click", () => go({ sort: sorted ? (down ? "" : `-${by}`) : by }, true));
      return button;
    }));
  };
  const row = (place) => {
    const n = episodes[place];
    const box = make("input", { type: "checkbox", "aria-label": `Choose ${ids[n]}` });
    box.checked = selection.has(n);
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
    const item = make("li", { "aria-setsize": episodes.length, "aria-posinset": place + 1 }, ...(isExport ? [] : [box]), link);
    item.style.transform = `translateY(${place * rowHeight}px)`;
    return item;
  };
  const drawRows = () => {
    if ($("overview").hidden) return;
    const top = list.getBoundingClientRect().top;
    const first = Math.max(0, Math.floor(-top / rowHeight) - 12);
    const end = Math.min(episodes.length, Math.ceil((innerHeight - top) / rowHeight) + 12);
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
  const drawList = (fragment) => {
    episodes = matches(fragment);
    rows = new Map();
    list.replaceChildren();
    rowHeight = parseFloat(getComputedStyle(list).getPropertyValue("--row")) * parseFloat(getComputedStyle(document.documentElement).fontSize);
    list.style.height = `${episodes.length * rowHeight}px`;
    drawRows();
    drawSelection();
  };
  const focusRow = (place) => {
    if (place < 0 || place >= episodes.length) return;
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
  const drawSelection = () => {
    const count = selection.size;
    $("choose").textContent = count ? "Choose none" : `Choose these ${Math.min(episodes.length, MAX_EXPORTED)}`;
    $("choose").hidden = isExport || (!count && !episodes.length);
    const link = $("export");
    link.hidden = isExport;
    const can = count > 0 && count <= MAX_EXPORTED;
    link.textContent = count > MAX_EXPORTED ? `${count} chosen: at most ${MAX_EXPORTED} at a time` : count ? `Export ${count}` : "Export";
    link.setAttribute("aria-disabled", String(!can));
    link.title = "One HTML file that opens without a server";
    if (can) link.href = `export?episodes=${[...selection].sort((a, b) => a - b).join()}`;
    else link.removeAttribute("href");
  };
  const choose = (all, on) => {
    for (const n of all) selection[on ? "add" : "delete"](n);
    for (const [place, element] of rows) {
      const box = element.querySelector("input");
      if (box) box.checked = selection.has(episodes[place]);
    }
    drawSelection();
  };
  $("choose").addEventListener("click", () => (selection.size ? choose([...selection], false) : choose(episodes.slice(0, MAX_EXPORTED), true)));
  const toggle = (place) => choose([episodes[place]], !selection.has(episodes[place]));

  return { drawHeads, drawList, drawRows, focusRow, focusedRow, toggle, size: () => episodes.length, placeOf: (n) => episodes.indexOf(n) };
};
