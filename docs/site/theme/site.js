// The divider between before and after follows the slider, which the pointer and the arrow keys move.
for (const box of document.querySelectorAll(".ba")) {
  const slider = box.querySelector("input");
  const show = () => box.style.setProperty("--x", slider.value + "%");
  slider.addEventListener("input", show);
  show();
}

// The theme's search is a dialog without a name.
document.querySelector('[data-md-component="search"][role="dialog"]')?.setAttribute("aria-label", "Search");

// The page "Try it": pictures made before, chosen by screen, corruption, severity and seed.
const form = document.querySelector("form.try");
if (form) {
  const choices = JSON.parse(document.getElementById("choices").textContent);
  const [clean, over] = document.querySelectorAll(".ba img");
  const said = document.querySelector(".tried");
  const fields = ["screen", "corruption", "level", "seed"];
  const choose = () => {
    const { levels, missing } = choices[form.corruption.value];
    const level = levels.includes(Number(form.level.value)) ? form.level.value : "3";
    form.level.replaceChildren(...levels.map((number) => new Option(number, number, false, String(number) === level)));
    const [screen, corruption, , seed] = fields.map((name) => form[name].value);
    const file = `${corruption}/${screen}-level${level}-seed${seed}.webp`;
    over.hidden = missing.includes(file);
    clean.src = `pictures/${screen}.webp`;
    if (!over.hidden) over.src = `pictures/${file}`;
    const severity = levels.length > 1 ? ` --severity ${level}` : "";
    const command = document.createElement("code");
    command.textContent =
      `hijack apply examples/recordings/images/${screen}.png ${corruption} -o out.png --sample ${screen} --seed ${seed}${severity}`;
    said.replaceChildren(command, over.hidden ? " refuses this screen, and says why." : "");
    history.replaceState(null, "", "#" + new URLSearchParams(fields.map((name) => [name, form[name].value])));
  };
  for (const [name, value] of new URLSearchParams(location.hash.slice(1))) {
    if (!fields.includes(name)) continue;
    if (name === "level") form.level.replaceChildren(new Option(value, value, false, true));
    else if ([...form[name].options].some((option) => option.value === value)) form[name].value = value;
  }
  form.addEventListener("input", choose);
  form.addEventListener("submit", (event) => event.preventDefault());
  choose();
}

// The search of the suite: a task shows if all words are in its section or in the heading of its domain.
const finder = document.querySelector(".finder input");
if (finder) {
  const sections = [];
  let domain = null;
  for (const element of [...document.querySelector(".finder").parentElement.children]) {
    if (element.tagName === "H2") domain = element;
    if (element.tagName === "H3") sections.push({ domain, parts: [] });
    if (sections.length && element.tagName !== "H2") sections.at(-1).parts.push(element);
  }
  for (const section of sections) {
    section.text = [section.domain, ...section.parts].map((part) => part.textContent.toLowerCase()).join(" ");
  }
  const search = () => {
    const words = finder.value.toLowerCase().split(/\s+/).filter(Boolean);
    const domains = new Set();
    let count = 0;
    for (const { domain: heading, parts, text } of sections) {
      const shows = words.every((word) => text.includes(word));
      if (shows) domains.add(heading);
      count += shows;
      for (const part of parts) part.hidden = !shows;
    }
    for (const { domain: heading } of sections) heading.hidden = !domains.has(heading);
    document.querySelector(".finder [role=status]").textContent = `${count} of ${sections.length} tasks`;
  };
  finder.addEventListener("input", search);
  search();
}

// What scrolls sideways can be reached by the keyboard.
addEventListener("load", () => {
  for (const box of document.querySelectorAll(".md-typeset__scrollwrap, .md-typeset pre > code")) {
    if (box.scrollWidth > box.clientWidth) box.tabIndex = 0;
  }
});
