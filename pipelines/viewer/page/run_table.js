"use strict";

// The table of agents and corruptions, and the filters below it.
hijack.runTable = (data) => {
  const { $, make, address } = hijack;
  const { FILTERS, run, texts, numbers, total, text, searchMask, filterMask } = data;

  // ---- the table ----
  // The last attempt at a case counts, as in the report.
  const cells = () => {
    const cellsByKey = new Map();
    for (let n = 0; n < total; n++) {
      if (!run.last[n]) continue;
      const key = `${texts.agent.codes[n]},${texts.corruption.codes[n]}`;
      const cell = cellsByKey.get(key) || { all: 0, counted: 0, sum: 0 };
      cell.all += 1;
      if (run.counts[n]) {
        cell.counted += 1;
        cell.sum += numbers.score[n] ?? 0;
      }
      cellsByKey.set(key, cell);
    }
    return cellsByKey;
  };
  const percent = (share) => (share === 1 || share === 0 ? `${100 * share}` : (100 * share).toFixed(share > 0.995 || share < 0.005 ? 1 : 0));
  const table = cells();
  const inputsByAgent = new Map(); // by agent, in words
  for (let n = 0; n < total; n++) if (text("given", n)) inputsByAgent.set(text("agent", n), text("given", n));
  let lastQuestion = "";
  const narrow = window.matchMedia("(max-width: 40rem)");
  const drawBoard = (fragment) => {
    const question = `${narrow.matches} ${fragment.agent} ${fragment.corruption}`;
    if (question === lastQuestion) return;
    lastQuestion = question;
    const [down, across] = narrow.matches ? ["corruption", "agent"] : ["agent", "corruption"];
    const jump = (changes) => address({ agent: "", corruption: "", episode: "", step: "", beside: "", ...changes });
    const breakable = (value) => value.split(/(?<=_)/).flatMap((word) => [word, make("wbr")]); // long names break at _
    const head = (name, value) => {
      const inputs = name === "agent" && inputsByAgent.get(value); // results of an agent that was told more mean something else
      const note = inputs ? [make("small", { class: "given", title: `given ${inputs}` }, `given ${inputs}`)] : [];
      return make("th", { scope: name === down ? "row" : "col", title: value }, make("a", { href: jump({ [name]: value }) }, ...breakable(value || "?")), ...note);
    };
    const cell = (row, column) => {
      const codes = { [down]: row, [across]: column };
      const figures = table.get(`${codes.agent},${codes.corruption}`);
      if (!figures) return make("td");
      const [agent, corruption] = [texts.agent.values[codes.agent], texts.corruption.values[codes.corruption]];
      const share = figures.counted ? figures.sum / figures.counted : null;
      const words = share === null ? "–" : `${percent(share)} %`;
      const link = make("a", { href: jump({ agent, corruption }), "aria-label": `${agent}, ${corruption}: ${words}, ${figures.counted} of ${figures.all} count` }, words, make("small", {}, String(figures.counted)));
      link.style.setProperty("--s", String(share ?? 0));
      if (fragment.agent === agent && fragment.corruption === corruption) link.setAttribute("aria-current", "true");
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
  const fillFilters = (fragment) => {
    const searchHits = searchMask(fragment.q || "");
    const masks = Object.fromEntries(Object.keys(FILTERS).map((name) => [name, filterMask(fragment, name)]));
    for (const name of Object.keys(FILTERS)) {
      const select = filters.elements[name];
      if (!select) continue;
      const otherMasks = Object.entries(masks).filter(([other, mask]) => other !== name && mask).map(([, mask]) => mask);
      if (searchHits) otherMasks.push(searchHits);
      const { values, codes } = texts[name];
      const counts = new Array(values.length).fill(0);
      for (let n = 0; n < total; n++) if (otherMasks.every((mask) => mask[n])) counts[codes[n]] += 1;
      const options = values.map((value, code) => [value, counts[code]]).filter(([value, count]) => value && (count || value === fragment[name]));
      select.replaceChildren(make("option", { value: "" }, "all"), ...options.map(([value, count]) => make("option", { value }, `${value} (${count})`)));
      select.value = fragment[name] || "";
      select.classList.toggle("on", Boolean(fragment[name]));
    }
    if (document.activeElement !== filters.elements.q) filters.elements.q.value = fragment.q || "";
  };

  return { filters, drawBoard, fillFilters };
};
