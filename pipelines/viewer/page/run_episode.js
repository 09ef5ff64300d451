"use strict";

// One episode in one of the two views: its pictures, words, effects and steps.
hijack.runEpisode = (data, views) => {
  const { make, show, pairs, address, reason } = hijack;
  const { drawOver } = hijack.runStrokes;
  const { isExport, source, numbers, text, timeText, scoreText, outcomeClass, sameCase } = data;
  const part = (view, selector) => view.querySelector(selector);
  const openGroups = new Set();

  const beforePicture = (n, step, data) => {
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
    const lossReason = step.lost;
    show(trouble, lossReason);
    frame.hidden = part(view, ".under").hidden = Boolean(lossReason);
    view.dataset.place = `${n}/${step.step}`;
    if (lossReason) return;
    const left = beforePicture(n, step, data);
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
        const message = await reason(image.src);
        if (view.dataset.place !== place) return;
        if (name === "after") frame.hidden = part(view, ".under").hidden = true;
        else frame.classList.add("single");
        show(part(view, ".stage > .trouble"), name === "after" ? message : `The clean screen: ${message}`);
      });
    }
    for (const box of view.querySelectorAll("[data-layer]")) {
      box.addEventListener("change", () => {
        if (box.dataset.layer === "boxes") frame.classList.toggle("show-boxes", box.checked);
        else frame.classList.toggle(`hide-${box.dataset.layer}`, !box.checked);
      });
    }
    for (const group of view.querySelectorAll(":scope > details")) {
      group.addEventListener("toggle", () => openGroups[group.open ? "add" : "delete"](group.className));
    }
  }

  const effectItem = (effect, all) => {
    const item = make("li", {}, make("strong", {}, effect.kind), all ? ` at step ${effect.step}` : "");
    const probe = (result, words) => {
      const verdict = result.ok ? words : result.problem || `${words}: no`;
      const line = make("span", { class: result.ok ? "probe" : "probe no" }, verdict);
      if (result.facts) line.title = result.facts;
      return line;
    };
    item.append(...effect.probes.map((result, k) => probe(result, k ? `probed again${result.facts ? `: ${result.facts}` : ""}` : `probed${result.facts ? `: ${result.facts}` : ""}`)));
    if (!effect.probes.length) item.append(make("span", { class: "probe no" }, "no probe was recorded"));
    if (all) {
      item.append(...effect.undone.map((result) => probe(result, "undone")));
      if (effect.did) item.append(make("pre", { tabindex: "0", "aria-label": "What it did" }, effect.did));
    }
    return item;
  };
  const ROLES = { check: "Checked the screen", summarise: "What happened since the last turn (d_t)" };
  const FAULTS = { drop: "input lost", repeat: "input repeated", offset: "pointer slipped" };
  const faultLabels = (step) => step.faults.map((fault) => FAULTS[fault] || fault);
  const drawText = (view, n, data, step) => {
    const last = data.steps.length - 1;
    const fill = (selector, words) => {
      part(view, selector).hidden = !words;
      return words;
    };
    if (fill(".said", step.said)) part(view, ".words").textContent = step.said;
    const actionText = step.action || (step.code ? "" : step.step === last ? "None: this is the last screen" : "No action");
    part(view, ".action-words").textContent = actionText + (step.recorded ? ` (recorded: ${step.recorded})` : "");
    show(part(view, ".code-text"), [step.code, step.ran && `# on the screen, in its own pixels:\n${step.ran}`].filter(Boolean).join("\n"));
    const faults = faultLabels(step).join(", ");
    show(part(view, ".did .arrived"), faults && `${faults[0].toUpperCase()}${faults.slice(1)}. What arrived: ${step.arrived}`);
    show(part(view, ".refused"), [step.error && `Refused: ${step.error}`, step.result, step.problem].filter(Boolean).join("\n"));
    part(view, ".happened").hidden = !step.effects.length;
    part(view, ".happened .effects").replaceChildren(...step.effects.map((k) => effectItem(data.effects[k], false)));
    part(view, ".watched").hidden = !step.onlooker.length;
    part(view, ".talk").replaceChildren(...step.onlooker.map(([role, words]) => make("p", {}, make("small", {}, ROLES[role] || role), words || "(nothing)")));
    const usage = step.usage || {};
    const figures = [
      ["tokens in", usage.input_tokens?.toLocaleString("en")],
      ["tokens out", usage.output_tokens?.toLocaleString("en")],
      ["model", usage.seconds && timeText(usage.seconds)],
      ["cost", usage.usd && `$${Number(usage.usd.toPrecision(3))}`],
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
    for (const group of view.querySelectorAll(":scope > details")) group.open = openGroups.has(group.className);
  };

  const drawStrip = (view, n, data, now) => {
    const strip = part(view, ".strip ol");
    if (strip.dataset.number !== String(n)) {
      strip.dataset.number = n;
      strip.replaceChildren(...data.steps.map((step) => {
        const small = make("span", { class: "small" });
        if (step.lost) small.append("–");
        else small.append(make("img", { alt: "", loading: "lazy", src: source.picture("strip", n, step.step) }));
        const labels = step.effects.map((k) => data.effects[k].kind);
        labels.push(...faultLabels(step));
        if (step.error) labels.push("refused");
        if (step.lost) labels.push("lost");
        const marks = make("span", { class: "marks" }, String(step.step), ...labels.map((word) => make("b", {}, word)));
        return make("li", {}, make("a", { href: "#", "data-step": step.step, "aria-label": `Step ${step.step}${labels.length ? `: ${labels.join(", ")}` : ""}` }, small, marks));
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
  const drawDamage = (view, data, verifyProblems = []) => {
    const all = [...new Set([...data.problems, ...verifyProblems])];
    const box = part(view, ".damage");
    box.hidden = !all.length;
    part(view, ".damage h3").textContent = all.length === 1 ? "This episode is damaged" : `This episode is damaged: ${all.length} problems`;
    part(view, ".damage ul").replaceChildren(...all.map((problem) => make("li", {}, problem)));
  };
  const drawView = (view, n, data, requestedStep, main, problems) => {
    view.hidden = false;
    const isOther = text("corruption", n) !== text("corruption", main);
    const inputs = text("given", n) && `given ${text("given", n)}`;
    part(view, ".who").textContent = [text("agent", n), inputs, isOther && text("corruption", n)].filter(Boolean).join(" · ");
    const end = part(view, ".outcome");
    end.className = outcomeClass(text("outcome", n));
    end.textContent = scoreText(n);
    const message = data.problem || data.reason || text("note", n);
    const endReason = { max_steps: "ended by the limit of steps", outside: "cut off from outside" }[data.ended];
    const usage = [
      numbers.steps[n] !== null && `${numbers.steps[n]} steps`,
      data.malformed && `${data.malformed} refused`,
      timeText(numbers.seconds[n]),
      numbers.tokens[n] && `${numbers.tokens[n].toLocaleString("en")} tokens`,
      numbers.usd[n] && `$${Number(numbers.usd[n].toPrecision(3))}`,
    ];
    part(view, ".note").textContent = [message, endReason, ...usage].filter(Boolean).join(" · ");
    drawDamage(view, data, problems);
    part(view, ".no-steps").hidden = !data.no_steps;
    part(view, ".no-steps").textContent = data.no_steps || "";
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
    const step = data.steps[Math.min(requestedStep, data.steps.length - 1)];
    drawPictures(view, n, step, data);
    drawText(view, n, data, step);
    drawOver(view, step);
    drawStrip(view, n, data, step.step);
  };

  return { drawView, drawDamage };
};
