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
  let seeking = false; // the search is wanted once the list stands
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

  const showOverview = (wanted) => {
    const last = $("episode").hidden ? null : places.get($("episode").dataset.id);
    $("episode").hidden = true;
    $("overview").hidden = false;
    document.title = `${run.title} – hijack view`;
    drawBoard(wanted);
    fillFilters(wanted);
    list.drawHeads(wanted);
    list.drawList(wanted);
    $("count").textContent = list.size() ? `${list.size().toLocaleString("en")} of ${total.toLocaleString("en")} episodes` : total ? "No episode matches" : "There are no episodes yet";
    $("clear").hidden = ![...Object.keys(FILTERS), "q"].some((name) => wanted[name]);
    $("heads").hidden = !list.size();
    if (seeking) {
      seeking = false;
      filters.elements.q.focus();
    } else if (last !== null && last !== undefined) {
      window.scrollTo(0, scrolled);
      list.focusRow(list.placeOf(last));
    }
  };

  // ---- one episode ----
  const known = new Map(); // the last episodes that were read
  let scrolled = 0;
  let shown = null; // what is shown: { main, other, step, last }

  const read = async (n) => {
    if (!known.has(n)) known.set(n, await source.episode(n));
    const episode = known.get(n);
    known.delete(n);
    known.set(n, episode);
    while (known.size > 8 || text("outcome", known.keys().next().value) === "unfinished" && known.size > 1) known.delete(known.keys().next().value);
    return episode;
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

  const drawKin = (n, step) => {
    const group = (label, all, name) => {
      if (all.length < 2) return "";
      const { codes } = texts[name]; // numbered in the order of the configuration, whichever episode ended first
      const ordered = all.sort((one, other) => codes[one] - codes[other] || one - other);
      const links = ordered.slice(0, 60).map((other) => {
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
    const [episode, beside] = await Promise.all([read(n), other === undefined ? null : read(other)]);
    if (!current()) return;
    const first = $("episode").hidden;
    if (first) scrolled = $("overview").hidden ? 0 : window.scrollY;
    $("overview").hidden = true;
    $("episode").hidden = false;
    $("episode").dataset.id = ids[n];
    const last = Math.max(0, episode.steps.length - 1, beside ? beside.steps.length - 1 : 0);
    const asked = /^\d{1,6}$/.test(wanted.step || "") ? Number(wanted.step) : 0;
    const step = Math.min(asked, last);
    const found = matches(wanted);
    const place = found.indexOf(n);
    shown = { n, other, step, last, back: found[place - 1], next: place < 0 ? found[0] : found[place + 1] };
    $("name").textContent = `${text("task", n) || ids[n]} · ${text("corruption", n)}${text("seed", n) ? ` · seed ${text("seed", n)}` : ""}`;
    show($("instruction"), text("instruction", n));
    $("position").textContent = place < 0 ? "not in the filter" : `${(place + 1).toLocaleString("en")} of ${found.length.toLocaleString("en")}`;
    $("step").textContent = episode.steps.length ? `step ${step} of ${last}` : "no steps";
    $("back").disabled = shown.back === undefined;
    $("next").disabled = shown.next === undefined;
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
    const work = $("episode").hidden ? inList(event) : shown && inEpisode(event);
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