"use strict";

// The address after # is the state: a filter each, q (search), page, row. The divider and the copy button are the gallery's.
document.addEventListener("DOMContentLoaded", async () => {
  const { $, make, makeSvg, shape, show, pairs, state, address, ask, reason, help, isPlain } = hijack;
  const go = (changes, replace = false) => {
    if (replace) {
      history.replaceState(null, "", address(changes));
      render();
    } else location.hash = address(changes);
  };

  // ---- the grid ----
  const filters = $("filters");
  let lastQuestion = null; // the question that the grid answers
  let scrollTop = 0;
  let focusSearch = false; // focus the search once the grid is drawn

  const addFilters = (labels) => {
    for (const [name, label] of Object.entries(labels)) {
      filters.append(make("label", { class: "field" }, make("span", {}, label), make("select", { name })));
    }
  };
  const fillFilters = (choices, selected) => {
    for (const [name, { values, more }] of Object.entries(choices)) {
      const select = filters.elements[name];
      const options = values.map(([value, count]) => make("option", { value }, `${value} (${count})`));
      if (more) options.push(make("option", { disabled: "" }, `${more} more: use the search`));
      select.replaceChildren(make("option", { value: "" }, "all"), ...options);
      select.value = selected[name] || "";
      select.classList.toggle("on", Boolean(selected[name]));
    }
  };
  const outline = ({ size, box, points }) => {
    const over = makeSvg("svg", { class: "over", "aria-hidden": "true" });
    if (!size) return over;
    over.setAttribute("viewBox", `0 0 ${size[0]} ${size[1]}`); // the picture is fitted alike: whole, in the middle
    if (box) {
      const [x, y, right, bottom] = box;
      over.append(...shape("rect", "target", { x, y, width: Math.max(0, right - x), height: Math.max(0, bottom - y) }));
    }
    if (points.length) over.append(...shape("circle", "action", { cx: points[0][0], cy: points[0][1], r: size[0] / 60 }));
    return over;
  };
  const titleSpan = (title) => { // of a long name the end is cut, never the step
    const at = title.lastIndexOf(" \u00b7 ");
    return make("span", { class: "title" }, make("span", {}, title.slice(0, at)), make("span", {}, title.slice(at)));
  };
  const tile = ({ row, id, title, instruction, action, chips, ...places }) => {
    const image = make("img", { alt: "", loading: "lazy", src: `thumb/${row}` });
    const thumb = make("span", { class: "thumb" }, image, outline(places));
    image.addEventListener("error", async () => {
      thumb.replaceChildren(make("span", { class: "why" }, await reason(image.src)));
    });
    const words = Object.entries(chips).map(([name, value], i) =>
      make("span", { class: i ? "chip" : "chip first" }, name === "inserted" ? (value === "yes" ? name : "") : chipText(name, value)));
    if (places.size) words.push(make("span", { class: "chip size" }, `${places.size[0]}×${places.size[1]}`));
    const caption = make("span", { class: "caption" },
      make("span", { class: "task" }, instruction || "No instruction"),
      make("span", { class: "done" }, action),
      make("span", { class: "chips" }, ...words.filter((chip) => chip.textContent)),
      titleSpan(title));
    return make("li", { class: "tile" }, make("a", { href: address({ row }), "data-row": row, title: id }, thumb, caption));
  };
  const chipText = (name, value) => (name === "score" ? `score ${value}` : value);

  const showGrid = async (fragment, current) => {
    const { row, ...query } = fragment;
    const question = `api/rows?${new URLSearchParams(query)}`;
    if (question !== lastQuestion) {
      const answer = await ask(question);
      if (!current()) return;
      lastQuestion = question;
      fillFilters(answer.filters, query);
      const search = filters.elements.q;
      if (document.activeElement !== search) search.value = query.q || "";
      $("count").textContent = answer.found ? `${answer.found} of ${about.rows} rows` : "No row matches";
      $("clear").hidden = !Object.keys(query).some((name) => name !== "page");
      $("page").value = answer.page;
      $("page").max = answer.pages;
      $("pages").textContent = `of ${answer.pages}`;
      for (const button of document.querySelectorAll("[data-turn]")) {
        const to = answer.page + Number(button.dataset.turn);
        button.disabled = to < 1 || to > answer.pages;
        button.dataset.to = to;
      }
      for (const pager of document.querySelectorAll(".pager")) pager.hidden = answer.pages === 1;
      $("tiles").replaceChildren(...answer.rows.map(tile));
    }
    const last = $("detail").hidden ? null : $("detail").dataset.row;
    $("detail").hidden = true;
    $("grid").hidden = false;
    document.title = `${about.title} – hijack view`;
    if (focusSearch) {
      focusSearch = false;
      filters.elements.q.focus();
    } else if (last !== null) {
      window.scrollTo(0, scrollTop);
      $("tiles").querySelector(`[data-row="${last}"]`)?.focus();
    }
  };

  let typingTimer;
  filters.addEventListener("submit", (event) => event.preventDefault());
  filters.addEventListener("input", (event) => {
    const { name, value } = event.target;
    clearTimeout(typingTimer);
    if (name === "q") typingTimer = setTimeout(() => go({ q: value.trim(), page: "" }, true), 200);
    else go({ [name]: value, page: "" });
  });
  $("clear").addEventListener("click", () => {
    filters.elements.q.value = "";
    location.hash = "";
    filters.elements.q.focus();
  });
  $("page").addEventListener("change", () => go({ page: $("page").value }));
  for (const button of document.querySelectorAll("[data-turn]")) {
    button.addEventListener("click", () => {
      go({ page: button.dataset.to });
      if (button.closest(".foot")) window.scrollTo(0, 0);
    });
  }

  // ---- one row ----
  const frame = $("frame");
  let open = null; // what is shown

  const drawOver = ({ size, box, points }) => {
    const over = $("over");
    over.replaceChildren();
    for (const layer of ["target", "action"]) {
      document.querySelector(`[data-layer=${layer}]`).disabled = !size || !(layer === "target" ? box : points.length);
    }
    if (!size) return;
    over.setAttribute("viewBox", `0 0 ${size[0]} ${size[1]}`);
    if (box) {
      const [x, y, right, bottom] = box;
      over.append(...shape("rect", "target", { x, y, width: Math.max(0, right - x), height: Math.max(0, bottom - y) }));
    }
    if (!points.length) return;
    const r = (7 * size[0]) / (frame.clientWidth || size[0]);
    const [[x, y], end] = points;
    over.append(...shape("path", "action", { d: `M${x - 2 * r} ${y}H${x - r / 2}M${x + r / 2} ${y}H${x + 2 * r}M${x} ${y - 2 * r}V${y - r / 2}M${x} ${y + r / 2}V${y + 2 * r}` }));
    over.append(...shape("circle", "action", { cx: x, cy: y, r }));
    if (!end) return;
    over.append(...shape("path", "action", { d: `M${x} ${y}L${end[0]} ${end[1]}` }));
    over.append(...shape("rect", "action", { x: end[0] - r / 2, y: end[1] - r / 2, width: r, height: r }));
  };

  const fit = (width, height) => {
    frame.style.setProperty("--w", width);
    frame.style.setProperty("--r", width / height);
  };
  const showPictures = ({ row, detail }) => {
    $("full").href = `picture/${row}`;
    frame.hidden = $("layers").hidden = false;
    frame.classList.add("loading");
    frame.classList.toggle("single", Boolean(detail.no_before));
    if (detail.size) fit(...detail.size);
    $("after").src = `picture/${row}`;
    if (detail.no_before) $("before").removeAttribute("src");
    else $("before").src = `before/${row}`;
    drawOver(detail);
  };
  $("after").addEventListener("load", () => {
    frame.classList.remove("loading");
    if (open && !open.detail.size) fit($("after").naturalWidth, $("after").naturalHeight);
  });
  for (const name of ["after", "before"]) {
    $(name).addEventListener("error", async () => {
      const row = open?.row;
      const message = await reason($(name).src);
      if (open?.row !== row) return;
      if (name === "after") frame.hidden = $("layers").hidden = true;
      else frame.classList.add("single");
      show($("problem"), name === "after" ? message : `The picture before: ${message}`);
    });
  }

  const link = (row, text, current) => {
    const element = make("a", { href: address({ row }) }, text);
    if (current) element.setAttribute("aria-current", "true");
    return element;
  };
  const openGroups = new Set(["Columns", "Step"]);
  const showText = (answer) => {
    const { detail, row } = answer;
    $("name").textContent = `${answer.title}${answer.chips.corruption ? ` · ${answer.chips.corruption}` : ""}`;
    $("instruction").textContent = answer.instruction;
    $("position").textContent = answer.position === null ? "not in the filter" : `${answer.position + 1} of ${answer.found}`;
    const size = detail.size ? `${detail.size[0]}×${detail.size[1]}` : "";
    $("size").textContent = [size, detail.no_before && `No picture before: ${detail.no_before}.`].filter(Boolean).join("  ");
    show($("problem"), detail.problem);
    $("action").textContent = detail.action;
    show($("code"), detail.code);
    $("notes").replaceChildren(...pairs(detail.notes));
    $("same").replaceChildren(...(answer.same_step.length > 1 ? answer.same_step.map(([to, name]) => link(to, name, to === row)) : []));
    $("steps").replaceChildren(...(answer.steps.length > 1 ? answer.steps.map(([to, step]) => link(to, step, to === row)) : []));
    $("plan").hidden = !detail.plan;
    $("plan").querySelector("code").textContent = detail.plan;
    const groups = Object.entries(detail.fields).map(([title, list]) => {
      const group = make("details", openGroups.has(title) ? { open: "" } : {}, make("summary", {}, title), make("dl", { class: "parameters" }, ...pairs(list)));
      group.addEventListener("toggle", () => openGroups[group.open ? "add" : "delete"](title));
      return group;
    });
    $("fields").replaceChildren(...groups);
    for (const [id, to] of Object.entries({ back: answer.back, next: answer.next, "step-back": answer.step_back, "step-next": answer.step_next })) {
      $(id).disabled = to === null;
      $(id).dataset.to = to ?? "";
    }
  };

  const showRow = async (fragment, current) => {
    const { page, ...query } = fragment;
    const answer = await ask(`api/row?${new URLSearchParams(query)}`);
    if (!current()) return;
    const first = $("detail").hidden;
    if (first) scrollTop = window.scrollY;
    open = answer;
    $("detail").dataset.row = answer.row;
    $("grid").hidden = true;
    $("detail").hidden = false;
    showText(answer);
    showPictures(answer);
    document.title = `${answer.id} – ${about.title}`;
    if (first) {
      window.scrollTo(0, 0);
      $("name").focus({ preventScroll: true });
    }
    for (const list of [$("same"), $("steps")]) {
      const currentLink = list.querySelector("[aria-current]");
      if (currentLink) list.scrollTop = currentLink.offsetTop - list.offsetTop - list.clientHeight / 2; // scrollIntoView would move the page
    }
  };

  const close = () => go({ row: "", page: open?.page > 1 ? open.page : "" });
  $("close").addEventListener("click", close);
  for (const id of ["back", "next", "step-back", "step-next"]) {
    $(id).addEventListener("click", () => go({ row: $(id).dataset.to }));
  }
  for (const box of document.querySelectorAll("[data-layer]")) {
    box.addEventListener("change", () => frame.classList.toggle(`hide-${box.dataset.layer}`, !box.checked));
  }
  const keys = help([
    ["← →", "previous and next row"],
    ["Shift+← Shift+→", "previous and next step of the trajectory, under the same corruption"],
    ["Esc", "back to all rows; on the divider: release it"],
    ["/", "search"],
    ["?", "this list"],
  ], () => {
    focusSearch = !$("detail").hidden;
    if (focusSearch) close();
    else filters.elements.q.focus();
  });
  document.addEventListener("keydown", (event) => {
    if ($("detail").hidden || keys.open || !isPlain(event)) return;
    const onDivider = event.target.matches?.("input[type=range]");
    if (event.key === "Escape") return onDivider ? event.target.blur() : close();
    if (onDivider || !["ArrowLeft", "ArrowRight"].includes(event.key)) return;
    const way = event.key === "ArrowLeft" ? "back" : "next";
    event.preventDefault();
    $(event.shiftKey ? `step-${way}` : way).click();
  });

  // ---- both ----
  let turn = 0;
  const render = async () => {
    const turnNumber = ++turn;
    const current = () => turnNumber === turn;
    const fragment = state();
    try {
      await (fragment.row === undefined ? showGrid : showRow)(fragment, current);
      if (current()) show($("trouble"), "");
    } catch (error) {
      if (!current()) return;
      show($("trouble"), error.message);
      $("trouble").append(" ", make("a", { href: "#" }, "All rows"));
    }
  };

  let about;
  try {
    about = await ask("api/about");
  } catch (error) {
    show($("trouble"), error.message);
    return;
  }
  $("title").textContent = about.title;
  $("facts").textContent = `${about.rows} rows, ${about.facts}`;
  if (about.problems.length) {
    $("problems").hidden = false;
    $("problems").querySelector("h2").textContent = about.problems.length === 1 ? "1 problem" : `${about.problems.length} problems`;
    $("problems").querySelector("ul").append(...about.problems.map((text) => make("li", {}, text)));
  }
  addFilters(about.filters);
  window.addEventListener("hashchange", render);
  render();
});
