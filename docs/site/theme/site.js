// The divider between before and after follows the slider, which the pointer and the arrow keys move.
for (const box of document.querySelectorAll(".ba")) {
  const slider = box.querySelector("input");
  const show = () => box.style.setProperty("--x", slider.value + "%");
  slider.addEventListener("input", show);
  show();
}
