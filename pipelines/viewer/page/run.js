"use strict";

// The page of a run. The address after # is the state: filters, q (search), sort, episode (id), step, beside (id).
// Its parts are in run_data.js, run_table.js, run_list.js, run_strokes.js and run_episode.js.
document.addEventListener("DOMContentLoaded", async () => {
  const { $, make, show, state, address, help, isField, isPlain } = hijack;
  let data;
  try {
    data = await hijack.runData();
  } catch (error) {
    show($("trouble"), error.message);
    return;
  }
  const { FILTERS, isExport, source, run, ids, texts, numbers, total, places, text, outcomeClass, matches, toEpisode, sameCase } = data;

  // ---- the address ----
  let focusSearch = false; // focus the search once the list is drawn
  const go = (changes, replace = false) => {
    if (!replace) location.hash = address(changes);
    else {
      history.replaceState(null, "", address(changes));
      render();
    }
  };
  const views = [...document.querySelectorAll(".view")];
  const { filters, drawBoard, fillFilters } = hijack.runTable(data);
  const list = hijack.runList(data, go);
  const { drawView, drawDamage } = hijack.runEpisode(data, views);

  const showOverview = (fragment) => {
    const last = $("episode").hidden ? null : places.get($("episode").dataset.id);
    $("episode").hidden = true;
    $("overview").hidden = false;
    document.title = `${run.title} – hijack view`;
    drawBoard(fragment);
    fillFilters(fragment);
    list.drawHeads(fragment);
    list.drawList(fragment);
    $("count").textContent = list.size() ? `${list.size().toLocaleString("en")} of ${total.toLocaleString("en")} episodes` : total ? "No episode matches" : "There are no episodes yet";
    $("clear").hidden = ![...Object.keys(FILTERS), "q"].some((name) => fragment[name]);
    $("heads").hidden = !list.size();
    if (focusSearch) {
      focusSearch = false;
      filters.elements.q.focus();
    } else if (last !== null && last !== undefined) {
      window.scrollTo(0, scrollTop);
      list.focusRow(list.placeOf(last));
    }
  };

  // ---- one episode ----
  const episodeCache = new Map(); // the last episodes that were read
  let scrollTop = 0;
  let shownEpisode = null; // { n, other, step, last, back, next }

  const read = async (n) => {
    if (!episodeCache.has(n)) episodeCache.set(n, await source.episode(n));
    const episode = episodeCache.get(n);
    episodeCache.delete(n);
    episodeCache.set(n, episode);
    while (episodeCache.size > 8 || text("outcome", episodeCache.keys().next().value) === "unfinished" && episodeCache.size > 1) episodeCache.delete(episodeCache.keys().next().value);
    return episode;
  };
  // What hijack verify finds in the files is asked for when somebody stays.
  const checks = new Map();
  let checkTimer;
  const checkLater = (n, current) => {
    clearTimeout(checkTimer);
    const showResult = () => {
      if (!current()) return;
      const problems = checks.get(n);
      $("checked").className = problems?.length === 0 && !run.scored ? "facts ok" : "facts";
      $("checked").textContent = problems?.length === 0 && !run.scored && episodeCache.get(n)?.steps.length ? "hijack verify finds nothing wrong with the files of this episode" : "";
      if (problems?.length) drawDamage(views[0], episodeCache.get(n), problems);
    };
    showResult();
    if (checks.has(n)) return;
    checkTimer = setTimeout(async () => {
      try {
        checks.set(n, await source.check(n));
      } catch {
        return; // the server has ended: the next click says so
      }
      showResult();
    }, 700);
  };

  const drawKin = (n, step) => {
    const group = (label, all, name) => {
      if (all.length < 2) return "";
      const { codes } = texts[name]; // numbered in the order of the configuration, whichever episode ended first
      const ordered = all.sort((a, b) => codes[a] - codes[b] || a - b);
      const links = ordered.slice(0, 60).map((other) => {
        const link = make("a", { href: toEpisode(other, { step, beside: "" }), class: outcomeClass(text("outcome", other)), title: ids[other] }, text(name, other) + (numbers.attempt[other] ? ` #${numbers.attempt[other] + 1}` : ""));
        if (other === n) link.setAttribute("aria-current", "true");
        return link;
      });
      return make("div", {}, make("span", {}, label), ...links);
    };
    $("kin").replaceChildren(group("Under", sameCase(n, ["agent", "task", "seed"]), "corruption"), group("By", sameCase(n, ["task", "corruption", "seed"]), "agent"));
  };
  const comparable = (n) => {
    const peers = sameCase(n, ["task", "corruption", "seed"]).filter((other) => other !== n);
    const clean = sameCase(n, ["agent", "task", "seed"]).filter((other) => other !== n && text("corruption", other) === "clean");
    return [...peers, ...clean];
  };
  const drawBeside = (n, other) => {
    const all = comparable(n);
    if (other !== undefined && !all.includes(other)) all.push(other);
    const option = (peer) => make("option", { value: ids[peer] }, `${text("agent", peer)}${texts.corruption.codes[peer] === texts.corruption.codes[n] ? "" : `, ${text("corruption", peer)}`} (${text("outcome", peer)})`);
    $("beside").replaceChildren(make("option", { value: "" }, "nothing"), ...all.map(option));
    $("beside").value = other === undefined ? "" : ids[other];
    $("beside").closest("label").hidden = !all.length;
  };

  const showEpisode = async (fragment, current) => {
    const n = places.get(fragment.episode);
    if (n === undefined) throw new Error(`There is no episode ${fragment.episode} here.`);
    const other = fragment.beside ? places.get(fragment.beside) : undefined;
    if (fragment.beside && other === undefined) throw new Error(`There is no episode ${fragment.beside} here to set beside it.`);
    const [episode, beside] = await Promise.all([read(n), other === undefined ? null : read(other)]);
    if (!current()) return;
    const first = $("episode").hidden;
    if (first) scrollTop = $("overview").hidden ? 0 : window.scrollY;
    $("overview").hidden = true;
    $("episode").hidden = false;
    $("episode").dataset.id = ids[n];
    const last = Math.max(0, episode.steps.length - 1, beside ? beside.steps.length - 1 : 0);
    const requestedStep = /^\d{1,6}$/.test(fragment.step || "") ? Number(fragment.step) : 0;
    const step = Math.min(requestedStep, last);
    const matching = matches(fragment);
    const place = matching.indexOf(n);
    shownEpisode = { n, other, step, last, back: matching[place - 1], next: place < 0 ? matching[0] : matching[place + 1] };
    $("name").textContent = `${text("task", n) || ids[n]} · ${text("corruption", n)}${text("seed", n) ? ` · seed ${text("seed", n)}` : ""}`;
    show($("instruction"), text("instruction", n));
    $("position").textContent = place < 0 ? "not in the filter" : `${(place + 1).toLocaleString("en")} of ${matching.length.toLocaleString("en")}`;
    $("step").textContent = episode.steps.length ? `step ${step} of ${last}` : "no steps";
    $("back").disabled = shownEpisode.back === undefined;
    $("next").disabled = shownEpisode.next === undefined;
    $("step-back").disabled = step <= 0;
    $("step-next").disabled = step >= last;
    drawKin(n, step);
    drawBeside(n, other);
    $("views").classList.toggle("two", Boolean(beside));
    drawView(views[0], n, episode, step, n, checks.get(n) || []);
    if (beside) drawView(views[1], other, beside, step, n, checks.get(other) || []);
    else views[1].hidden = true;
    document.title = `${ids[n]} – ${run.title}`;
    checkLater(n, current);
    if (first) {
      window.scrollTo(0, 0);
      $("name").focus({ preventScroll: true });
    }
  };
  window.addEventListener("resize", () => {
    if (shownEpisode && !$("episode").hidden) render();
  });

  // ---- buttons and keys ----
  const close = () => go({ episode: "", step: "", beside: "" });
  const move = (n) => n !== undefined && go({ episode: ids[n], step: "", beside: "" });
  const toStep = (step) => step >= 0 && step <= shownEpisode.last && go({ step }, true);
  $("close").addEventListener("click", close);
  $("back").addEventListener("click", () => move(shownEpisode.back));
  $("next").addEventListener("click", () => move(shownEpisode.next));
  $("step-back").addEventListener("click", () => toStep(shownEpisode.step - 1));
  $("step-next").addEventListener("click", () => toStep(shownEpisode.step + 1));
  $("beside").addEventListener("change", () => go({ beside: $("beside").value }));
  $("clear").addEventListener("click", () => {
    filters.elements.q.value = "";
    location.hash = address({}, { sort: state().sort });
    filters.elements.q.focus();
  });
  let typingTimer;
  filters.addEventListener("submit", (event) => event.preventDefault());
  filters.addEventListener("input", (event) => {
    const { name, value } = event.target;
    clearTimeout(typingTimer);
    if (name === "q") typingTimer = setTimeout(() => go({ q: value.trim() }, true), 120);
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
    focusSearch = !$("episode").hidden;
    if (focusSearch) close();
    else filters.elements.q.focus();
  });
  const flip = () => {
    for (const input of document.querySelectorAll(".view:not([hidden]) .frame input")) {
      input.value = input.value === "100" ? "0" : "100";
      input.dispatchEvent(new Event("input"));
    }
  };
  const beside = () => {
    const [first] = comparable(shownEpisode.n);
    go({ beside: shownEpisode.other === undefined && first !== undefined ? ids[first] : "" });
  };
  const inEpisode = (event) => {
    const episodes = { ArrowLeft: () => move(shownEpisode.back), ArrowRight: () => move(shownEpisode.next) };
    const steps = {
      ArrowLeft: () => toStep(shownEpisode.step - 1),
      ArrowRight: () => toStep(shownEpisode.step + 1),
      Home: () => toStep(0),
      End: () => toStep(shownEpisode.last),
      Escape: close,
      b: flip,
      c: beside,
    };
    return (event.shiftKey ? episodes : steps)[event.key];
  };
  const inList = (event) => {
    const place = list.focusedRow();
    const steps = {
      ArrowDown: () => list.focusRow(place + 1),
      ArrowUp: () => list.focusRow(place - 1),
      x: () => place >= 0 && !isExport && list.toggle(place),
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
    const work = $("episode").hidden ? inList(event) : shownEpisode && inEpisode(event);
    if (!work) return;
    event.preventDefault();
    work();
  });
  window.addEventListener("scroll", list.drawRows, { passive: true });
  window.addEventListener("resize", () => {
    if (!$("overview").hidden) showOverview(state());
  });

  // ---- both ----
  let turn = 0;
  const render = async () => {
    const turnNumber = ++turn;
    const current = () => turnNumber === turn;
    const fragment = state();
    try {
      if (fragment.episode === undefined) showOverview(fragment);
      else await showEpisode(fragment, current);
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