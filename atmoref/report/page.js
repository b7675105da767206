"use strict";
for (const section of document.querySelectorAll("section")) {
  const stack = section.querySelector(".stack");
  if (!stack) continue;
  const images = [...stack.querySelectorAll("img")];
  const buttons = [...section.querySelectorAll("button")];
  const flip = section.querySelector(".flip"), zoom = section.querySelector(".zoom"), out = section.querySelector("output");
  const show = () => {
    const at = Number(flip.value), below = Math.floor(at);
    images.forEach((image, i) => { image.style.opacity = i === below ? 1 : i === below + 1 ? at - below : 0; });
    const nearest = Math.round(at);
    buttons.forEach((button, i) => button.setAttribute("aria-pressed", String(i === nearest)));
    out.textContent = images[nearest].title + ", " + zoom.value + "x";
  };
  const size = () => {
    stack.style.width = images[0].naturalWidth * zoom.value + "px";
    stack.style.height = images[0].naturalHeight * zoom.value + "px";
    show();
  };
  flip.addEventListener("input", show);
  zoom.addEventListener("input", size);
  buttons.forEach((button, i) => button.addEventListener("click", () => { flip.value = i; show(); }));
  section.querySelector(".frame").addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    zoom.value = Number(zoom.value) + (event.deltaY < 0 ? 1 : -1);
    size();
  }, { passive: false });
  if (images[0].complete && images[0].naturalWidth) size(); else images[0].addEventListener("load", size);
}
