"use strict";

// Sorts, filters and chooses columns of the table. The choices stand in the address, after #.
(() => {
  const form = document.querySelector("form.choices");
  const table = document.querySelector("table.board");
  const body = table.tBodies[0];
  const heads = [...table.tHead.rows[0].cells];
  const rows = [...body.rows];
  const keys = heads.map((head) => head.dataset.key);
  const boxes = [...form.querySelectorAll("input[name=column]")];
  const sorted = { key: "rank", down: false };

  function text(row, key) {
    return row.cells[keys.indexOf(key)].firstChild.textContent;
  }

  function order(row) {
    const at = keys.indexOf(sorted.key);
    const value = row.cells[at].dataset.order;
    if (value === undefined) return null;
    return sorted.key === "rank" || "number" in heads[at].dataset ? Number(value) : value;
  }

  function compare(one, other) {
    const [a, b] = [order(one), order(other)];
    if (a === null || b === null) return (a === null) - (b === null);
    const direction = sorted.down ? -1 : 1;
    if (a !== b) return direction * (typeof a === "number" ? a - b : a.localeCompare(b));
    return rows.indexOf(one) - rows.indexOf(other);
  }

  function matches(row) {
    const { setting, inputs, ranked } = form.elements;
    const words = form.elements.text.value.toLowerCase().split(/\s+/).filter(Boolean);
    const found = ["agent", "setting", "run"].map((key) => text(row, key)).join(" ").toLowerCase();
    return (
      (!setting.value || text(row, "setting") === setting.value) &&
      (!inputs.value || text(row, "inputs") === inputs.value) &&
      (!ranked.checked || !row.classList.contains("unranked")) &&
      words.every((word) => found.includes(word))
    );
  }

  // A condition that no agent in sight was played under has neither a column nor a choice.
  function isEmpty(key) {
    const at = keys.indexOf(key);
    return key.startsWith("under-") && !rows.some((row) => !row.hidden && "order" in row.cells[at].dataset);
  }

  function show() {
    for (const row of rows) row.hidden = !matches(row);
    const empty = keys.map(isEmpty);
    boxes.forEach((box, at) => { box.parentElement.hidden = empty[at]; });
    for (const row of [table.tHead.rows[0], ...rows]) {
      [...row.cells].forEach((cell, at) => { cell.hidden = empty[at] || !boxes[at].checked; });
    }
    body.append(...[...rows].sort(compare));
    heads.forEach((head) => {
      const active = head.dataset.key === sorted.key;
      head.setAttribute("aria-sort", !active ? "none" : sorted.down ? "descending" : "ascending");
    });
    form.querySelector("output").value = `${rows.filter((row) => !row.hidden).length} of ${rows.length} agents`;
  }

  function save() {
    const state = new URLSearchParams({
      setting: form.elements.setting.value,
      inputs: form.elements.inputs.value,
      text: form.elements.text.value,
      ranked: form.elements.ranked.checked ? "1" : "",
      sort: (sorted.down ? "-" : "") + sorted.key,
      columns: boxes.filter((box) => box.checked).map((box) => box.value).join(","),
    });
    history.replaceState(null, "", `#${state}`);
  }

  function load() {
    const state = new URLSearchParams(location.hash.slice(1));
    for (const name of ["setting", "inputs", "text"]) {
      const control = form.elements[name];
      const value = state.get(name);
      const known = name === "text" || [...(control.options ?? [])].some((it) => it.value === value);
      if (value !== null && known) control.value = value;
    }
    if (state.has("ranked")) form.elements.ranked.checked = state.get("ranked") === "1";
    const sort = state.get("sort") ?? "rank";
    if (keys.includes(sort.replace(/^-/, ""))) {
      sorted.down = sort.startsWith("-");
      sorted.key = sort.replace(/^-/, "");
    }
    if (state.has("columns")) {
      const listed = state.get("columns").split(",");
      boxes.forEach((box) => { box.checked = listed.includes(box.value); });
    }
    show();
  }

  function sortBy(head) {
    const { key } = head.dataset;
    sorted.down = sorted.key === key ? !sorted.down : "number" in head.dataset;
    sorted.key = key;
    show();
    save();
  }

  heads.forEach((head) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => sortBy(head));
  });
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("input", () => { show(); save(); });
  addEventListener("hashchange", load);
  form.hidden = false;
  load();
})();
