// The nodes of `layer="dom"`, in our own world of a page, whose scripts see neither this object nor a node of it: the
// nodes are in a closed shadow root of the page's own body, whose children are shown by its slot.
(() => {
  if (globalThis.agenthijackLayer || window !== top) return;
  const state = { body: null, root: null, box: null };

  // Return the node of ours under the pointer, or null.
  const findNode = (event) => {
    if (!state.box) return null;
    const node = state.root.elementFromPoint(event.clientX, event.clientY);
    return node && state.box.contains(node) ? node : null;
  };
  const keepFromPage = (event) => {
    const node = findNode(event);
    if (!node) return;
    event.stopImmediatePropagation();
    if (event.cancelable) event.preventDefault();
    const button = event.type === 'click' && node.closest('button');
    if (button) button.closest('[role=dialog]').remove();
  };
  for (const type of ['pointerdown', 'pointerup', 'pointermove', 'mousedown', 'mouseup', 'mousemove', 'click', 'dblclick',
    'auxclick', 'contextmenu', 'wheel']) addEventListener(type, keepFromPage, { capture: true, passive: false });

  const make = (tag, [x, y, width, height]) => {
    const node = document.createElement(tag);
    node.style.cssText = `all: initial; direction: ltr; position: absolute; display: block; left: ${x}px; top: ${y}px;
      width: ${width}px; height: ${height}px; forced-color-adjust: none; pointer-events: inherit; user-select: none`;
    return node;
  };
  const addParts = (parent, parts, images) => {
    for (const part of parts) {
      const isPicture = part.image !== undefined;
      const node = make(part.tag, part.box);
      if (part.fill) node.style.background = part.fill;
      if (isPicture) {
        node.width = images[part.image].width;
        node.height = images[part.image].height;
        node.style.imageRendering = 'pixelated';
        node.getContext('2d').drawImage(images[part.image], 0, 0);
      }
      if (isPicture || part.fill) node.ariaHidden = 'true';
      if (part.tag === 'button') node.tabIndex = -1;
      if (part.text !== undefined) {
        node.textContent = part.text;
        node.style.cssText += `; color: transparent; white-space: pre; overflow: hidden; cursor: default;
          font: ${part.font}px/${part.box[3]}px sans-serif`;
      }
      addParts(node, part.parts || [], images);
      parent.append(node);
    }
  };
  const decode = (text) => createImageBitmap(
    new Blob([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))], { type: 'image/png' }),
    { colorSpaceConversion: 'none' });

  const erase = () => {
    if (state.box) state.box.remove();
    state.box = null;
    return state.root ? state.root.childElementCount - 1 : 0; // all but the slot
  };

  // Draw; return why that is impossible, or "".
  const draw = async ({ scale, sprites, places }) => {
    erase();
    const body = document.body;
    if (!(body instanceof HTMLBodyElement)) return `a document of ${document.contentType} has no body of HTML`;
    if (devicePixelRatio !== scale) return `the page is zoomed: its pixel ratio is ${devicePixelRatio}, not ${scale}`;
    if (visualViewport.scale !== 1) return `the page is zoomed by ${visualViewport.scale}`;
    if (state.body !== body) {
      try {
        state.root = body.attachShadow({ mode: 'closed' });
      } catch (error) {
        return `the body of the page has a shadow root of its own (${error.message})`;
      }
      state.root.append(document.createElement('slot'));
      state.body = body;
    }
    const box = make('div', [0, 0, 0, 0]);
    // In the top layer, no property of the page's elements moves, clips or covers it.
    box.popover = 'manual';
    box.style.cssText += `; position: fixed; inset: 0; width: auto; height: auto; overflow: hidden; pointer-events: none;
      zoom: ${1 / (body.currentCSSZoom || 1)}`;
    // In this one, a CSS pixel is a pixel of the screen: the layout rounds to CSS pixels.
    const screen = make('div', [0, 0, innerWidth * scale, innerHeight * scale]);
    if (scale !== 1) screen.style.cssText += `; transform: scale(${1 / scale}); transform-origin: 0 0`;
    box.append(screen);
    for (const sprite of sprites) sprite.bitmaps = await Promise.all(sprite.images.map(decode));
    for (const [index, x, y] of places) {
      const { width, height, role, label, parts, bitmaps } = sprites[index];
      const node = make('div', [x, y, width, height]);
      node.role = role;
      node.ariaLabel = label;
      if (role === 'dialog') node.style.pointerEvents = 'auto';
      addParts(node, parts, bitmaps);
      screen.append(node);
    }
    if (!body.isConnected || document.body !== body) return 'the document changed while it was drawn on';
    state.box = box;
    state.root.append(box);
    box.showPopover();
    return '';
  };

  // Return what the document has now.
  const look = () => {
    const ratio = devicePixelRatio;
    const nodes = state.box ? [...state.box.firstChild.children] : [];
    return {
      shown: Boolean(state.box && state.box.matches(':popover-open') && state.box.checkVisibility()),
      boxes: nodes.map((node) => {
        const { x, y, width, height } = node.getBoundingClientRect();
        return [x * ratio, y * ratio, width * ratio, height * ratio];
      }),
      texts: nodes.map((node) => node.innerText.trim()),
      area: [Math.round(visualViewport.width * ratio), Math.round(visualViewport.height * ratio)],
    };
  };
  globalThis.agenthijackLayer = { draw, erase, look };
})()
