"use strict";
// Values under the pointer: of a figure its axes' place, of a photo the nearest corner's error.
const tip = document.createElement("div");
tip.id = "tip";
tip.hidden = true;
document.body.append(tip);

function show(event, text) {
  tip.textContent = text;
  tip.hidden = !text;
  const left = Math.min(event.clientX + 14, window.innerWidth - tip.offsetWidth - 4);
  tip.style.left = `${Math.max(4, left)}px`;
  tip.style.top = `${event.clientY + 18}px`;
}

function follow(element, words) {
  element.addEventListener("pointermove", (event) => show(event, words(event)));
  element.addEventListener("pointerleave", () => { tip.hidden = true; });
}

// Where the pointer is in the drawing's own units.
function place(svg, event) {
  const box = svg.getBoundingClientRect(), view = svg.viewBox.baseVal;
  return [
    view.x + ((event.clientX - box.left) / box.width) * view.width,
    view.y + ((event.clientY - box.top) / box.height) * view.height,
  ];
}

for (const figure of document.querySelectorAll("figure[data-axes]")) {
  const [numbers, xWords, yWords] = figure.dataset.axes.split("|");
  const [left, top, width, height, x0, x1, y0, y1, xDigits, yDigits] =
    numbers.split(" ").map(Number);
  const svg = figure.querySelector("svg");
  follow(svg, (event) => {
    const [x, y] = place(svg, event);
    const across = (x - left) / width, down = (y - top) / height;
    if (across < 0 || across > 1 || down < 0 || down > 1) return "";
    const values = [x0 + across * (x1 - x0), y1 + down * (y0 - y1)];
    return `${values[0].toFixed(xDigits)}${xWords}, ${values[1].toFixed(yDigits)}${yWords}`;
  });
}

// "M1 2L3 4M5 6L7 8" -> [[1, 2, 3, 4], [5, 6, 7, 8]]
function lines(path) {
  const text = path ? path.getAttribute("d") : "";
  return text.split("M").slice(1).map((part) => part.split(/[L ]/).map(Number));
}

for (const photo of document.querySelectorAll(".photo[data-zoom]")) {
  const svg = photo.querySelector("svg");
  if (!svg) continue;
  const errors = lines(svg.querySelector(".errors")), zoom = Number(photo.dataset.zoom);
  follow(photo, (event) => {
    const [x, y] = place(svg, event), reach = svg.viewBox.baseVal.width / 30;
    let nearest = null, least = reach;
    for (const [x0, y0, x1, y1] of errors) {
      const far = Math.hypot(x0 - x, y0 - y);
      if (far < least) {
        least = far;
        nearest = `corner at (${x0}, ${y0}), off by ${(Math.hypot(x1 - x0, y1 - y0) / zoom).toFixed(3)} px`;
      }
    }
    return nearest || `(${x.toFixed(0)}, ${y.toFixed(0)})`;
  });
}
