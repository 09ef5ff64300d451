"use strict";

// What an action does, drawn over the picture.
hijack.runStrokes = (() => {
  const { makeSvg, shape, show } = hijack;
  const part = (view, selector) => view.querySelector(selector);

  const KEYS = { type: "types", hotkey: "presses", key_down: "holds", key_up: "releases", wait: "waits", done: "says DONE", fail: "says FAIL" };
  const LABELS = { double_click: "double", triple_click: "triple", right_click: "right", middle_click: "middle", mouse_down: "down", mouse_up: "up", move: "move" };
  const drawOver = (view, step) => {
    const over = part(view, ".over");
    const frame = part(view, ".frame");
    over.replaceChildren();
    const keyTexts = step.strokes.filter((stroke) => KEYS[stroke.type]).map((stroke) => [KEYS[stroke.type], stroke.text ?? (stroke.type === "wait" && stroke.amount ? `${stroke.amount} s` : "")].filter(Boolean).join(" "));
    const word = step.strokes.length ? "" : KEYS[step.action];
    show(part(view, ".typed"), keyTexts.join("\n") || word || "");
    const has = { action: step.strokes.length || word, arrived: step.arrived_strokes.length, target: step.target, boxes: step.boxes.length };
    for (const box of view.querySelectorAll("[data-layer]")) {
      box.disabled = !step.size || !has[box.dataset.layer];
      box.closest("label").hidden = !has[box.dataset.layer] && box.dataset.layer !== "action";
    }
    if (!step.size) return;
    const [width, height] = step.size;
    over.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const unit = width / (frame.clientWidth || width); // a pixel of the page, in those of the picture
    over.append(makeSvg("path", { class: "boxes", d: step.boxes.map(([x1, y1, x2, y2]) => `M${x1} ${y1}H${x2}V${y2}H${x1}Z`).join("") }));
    if (step.target) {
      const [x, y, right, bottom] = step.target;
      over.append(...shape("rect", "target", { x, y, width: Math.max(0, right - x), height: Math.max(0, bottom - y) }));
    }
    for (const stroke of step.arrived_strokes) if (stroke.at || stroke.to) over.append(...strokeShapes(stroke, 8 * unit, "arrived"));
    const pointStrokes = step.strokes.filter((stroke) => stroke.at || stroke.to);
    for (const [k, stroke] of pointStrokes.entries()) {
      over.append(...strokeShapes(stroke, 8 * unit));
      const [x, y] = stroke.at || stroke.to;
      const words = [pointStrokes.length > 1 ? k + 1 : "", LABELS[stroke.type] || ""].filter(Boolean).join(" ");
      if (!words) continue;
      const isRight = x > width - 60 * unit; // inside the picture
      const label = makeSvg("text", { class: "number", x: x + (isRight ? -13 : 13) * unit, y: Math.max(y - 9 * unit, 15 * unit), "text-anchor": isRight ? "end" : "start" }, words);
      label.style.fontSize = `${13 * unit}px`;
      label.style.strokeWidth = `${3 * unit}px`;
      over.append(label);
    }
  };
  const arrow = (x, y, angle, r) => {
    const at = (turn, long) => `${x + long * Math.cos(angle + turn)} ${y + long * Math.sin(angle + turn)}`;
    return `M${at(0, 0)}L${at(2.7, 1.9 * r)}L${at(-2.7, 1.9 * r)}Z`;
  };
  const strokeShapes = ({ type, at, to, amount }, r, layer = "action") => {
    const shapes = [];
    const path = (d) => shapes.push(...shape("path", layer, { d }));
    const circle = ([x, y], size) => shapes.push(...shape("circle", layer, { cx: x, cy: y, r: size }));
    if (at && to) {
      path(`M${at[0]} ${at[1]}L${to[0]} ${to[1]}`);
      path(arrow(to[0], to[1], Math.atan2(to[1] - at[1], to[0] - at[0]), r));
      circle(at, r * 0.7);
      return shapes;
    }
    const [x, y] = at || to;
    if (type === "scroll") {
      const way = amount > 0 ? -1 : 1;
      path(`M${x} ${y - way * 2.5 * r}V${y + way * 2.5 * r}`);
      path(arrow(x, y + way * 2.5 * r, (way * Math.PI) / 2, r));
      return shapes;
    }
    path(`M${x - 2.2 * r} ${y}H${x - r / 2}M${x + r / 2} ${y}H${x + 2.2 * r}M${x} ${y - 2.2 * r}V${y - r / 2}M${x} ${y + r / 2}V${y + 2.2 * r}`);
    if (type !== "move") circle([x, y], r);
    if (["double_click", "triple_click"].includes(type)) circle([x, y], 1.6 * r);
    if (type === "triple_click") circle([x, y], 2.2 * r);
    return shapes;
  };

  return { drawOver };
})();
