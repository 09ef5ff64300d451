"use strict";

// What both pages of the viewer share: elements that hold text only, the address as state, questions, and help.
const hijack = (() => {
  const SVG = "http://www.w3.org/2000/svg";
  const $ = (id) => document.getElementById(id);
  const make = (tag, attributes = {}, ...children) => {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.append(...children);
    return element;
  };
  const makeSvg = (tag, attributes = {}, ...children) => {
    const element = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.append(...children);
    return element;
  };
  // What is drawn over a picture, with a light edge around it.
  const shape = (tag, layer, attributes) =>
    ["halo", layer].map((kind) => makeSvg(tag, { class: `${kind} for-${layer}`, ...attributes }));
  const show = (element, text) => {
    element.hidden = !text;
    element.textContent = text || "";
  };
  const pairs = (list) => list.map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value)));

  // A plus is a plus here (ids of inserted steps have one), not a space as in forms.
  const state = () => Object.fromEntries(new URLSearchParams(location.hash.slice(1).replaceAll("+", "%2B")));
  const address = (changes, from = state()) => {
    const all = Object.entries({ ...from, ...changes }).filter(([, value]) => value !== "" && value != null);
    return `#${String(new URLSearchParams(all)).replaceAll("+", "%20")}`;
  };

  const noAnswer = "No answer. Was `hijack view` ended? Start it again and open the address that it prints.";
  const ask = async (path) => {
    let answer;
    try {
      answer = await fetch(path);
    } catch {
      throw new Error(noAnswer);
    }
    if (!answer.ok) throw new Error(await answer.text());
    return answer.json();
  };
  const reason = async (path) => {
    if (path.startsWith("data:")) return "The picture cannot be shown by this browser.";
    try {
      const answer = await fetch(path);
      return answer.ok ? "The picture cannot be shown by this browser." : await answer.text();
    } catch {
      return "No answer from `hijack view`.";
    }
  };

  // Help on `?`, the search on `/`. Rows are [keys, what they do].
  const isField = (element) => element.matches?.("input:not([type=checkbox]), select, textarea");
  const isPlain = (event) => !(event.ctrlKey || event.altKey || event.metaKey);
  const help = (rows, search) => {
    const list = rows.map(([keys, description]) =>
      make("div", {}, make("dt", {}, ...keys.split(" ").flatMap((key) => [make("kbd", {}, key), " "])), make("dd", {}, description)));
    const closeButton = make("button", { type: "button" }, "Close");
    const dialog = make("dialog", { class: "help", "aria-label": "Keys" }, make("h2", {}, "Keys"), make("dl", { class: "parameters" }, ...list), closeButton);
    closeButton.addEventListener("click", () => dialog.close());
    dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
    document.body.append(dialog);
    for (const button of document.querySelectorAll("button.ask")) button.addEventListener("click", () => dialog.showModal());
    document.addEventListener("keydown", (event) => {
      if (!isPlain(event) || isField(event.target) || dialog.open) return;
      if (event.key === "?") dialog.showModal();
      else if (event.key === "/") search();
      else return;
      event.preventDefault();
    });
    return dialog;
  };

  return { $, make, makeSvg, shape, show, pairs, state, address, ask, reason, help, isField, isPlain };
})();
