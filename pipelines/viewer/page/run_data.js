"use strict";

// The episodes of a run: where they come from, their words, and which match a filter.
// The data come from the server, or lie in the page itself where episodes were exported.
hijack.runData = async () => {
  const { $, make, address, ask } = hijack;
  const FILTERS = { agent: "Agent", task: "Task", corruption: "Corruption", outcome: "Outcome", seed: "Seed" };
  const SEARCHED = ["instruction", "note", "said", "task", "agent", "corruption", "problem"];

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

  const run = await source.run();
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

  const toEpisode = (n, changes = {}) => address({ episode: ids[n], ...changes });
  const sameCase = (n, fields) => {
    const found = [];
    for (let other = 0; other < total; other++) {
      if (fields.every((name) => texts[name].codes[other] === texts[name].codes[n])) found.push(other);
    }
    return found;
  };

  return {
    FILTERS, isExport, source, run, ids, texts, numbers, total, places, text, tokenText, timeText, scoreText,
    outcomeClass, outcome, searched, filterOf, matches, toEpisode, sameCase,
  };
};
