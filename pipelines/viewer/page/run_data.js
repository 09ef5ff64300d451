"use strict";

// The episodes of a run: where they come from, their words, and which match a filter.
// The data come from the server, or lie in the page itself where episodes were exported.
hijack.runData = async () => {
  const { $, make, address, ask } = hijack;
  const FILTERS = { agent: "Agent", task: "Task", corruption: "Corruption", outcome: "Outcome", seed: "Seed" };
  const SEARCHED = ["instruction", "note", "said", "task", "agent", "corruption", "problem"];

  const embedded = JSON.parse($("run-data").textContent);
  const isExport = Boolean(embedded.episodes);
  const source = isExport
    ? {
        run: async () => embedded,
        episode: async (n) => embedded.episodes[n],
        check: async (n) => embedded.episodes[n].checked,
        picture: (kind, n, step) => embedded.pictures[embedded.places[`${kind === "strip" ? "seen" : kind}/${n}/${step}`]] || "data:,",
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
  const searchMask = (words) => {
    const needle = words.trim().toLowerCase();
    if (!needle) return null;
    const hits = SEARCHED.map((name) => [texts[name].codes, lowered[name].map((value) => value.includes(needle))]);
    return loweredIds.map((id, n) => id.includes(needle) || hits.some(([codes, has]) => has[codes[n]]));
  };
  const filterMask = (fragment, name) => {
    if (!fragment[name]) return null;
    const code = texts[name].values.indexOf(fragment[name]);
    return texts[name].codes.map((value) => value === code);
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
  const matching = (fragment) => {
    const masks = [...Object.keys(FILTERS).map((name) => filterMask(fragment, name)), searchMask(fragment.q || "")].filter(Boolean);
    const episodes = [];
    for (let n = 0; n < total; n++) if (masks.every((mask) => mask[n])) episodes.push(n);
    const [, down, by] = /^(-?)(.*)$/.exec(fragment.sort || "");
    const key = SORTS[by];
    if (!key) return episodes;
    const keys = new Map(episodes.map((n) => [n, key(n)]));
    const way = down ? -1 : 1;
    return episodes.sort((a, b) => (keys.get(a) < keys.get(b) ? -way : keys.get(a) > keys.get(b) ? way : a - b));
  };
  let cache = { question: null, episodes: [] };
  const matches = (fragment) => {
    const question = JSON.stringify([...Object.keys(FILTERS), "q", "sort"].map((name) => fragment[name] || ""));
    if (cache.question !== question) cache = { question, episodes: matching(fragment) };
    return cache.episodes;
  };

  const toEpisode = (n, changes = {}) => address({ episode: ids[n], ...changes });
  const sameCase = (n, fields) => {
    const episodes = [];
    for (let other = 0; other < total; other++) {
      if (fields.every((name) => texts[name].codes[other] === texts[name].codes[n])) episodes.push(other);
    }
    return episodes;
  };

  return {
    FILTERS, isExport, source, run, ids, texts, numbers, total, places, text, tokenText, timeText, scoreText,
    outcomeClass, outcome, searchMask, filterMask, matches, toEpisode, sameCase,
  };
};
