// The slider over two pictures of a group. Without this script the page shows the pictures side by side instead.
"use strict";
for (const viewer of document.querySelectorAll(".viewer")) {
  const pictures = [...document.querySelectorAll("#" + viewer.dataset.gallery + " img")];
  const [left, right] = viewer.querySelectorAll("select");
  const stage = viewer.querySelector(".stage"), range = viewer.querySelector("input[type=range]");
  const images = [...stage.querySelectorAll("img")], tags = [...stage.querySelectorAll(".tag")];
  for (const select of [left, right])
    pictures.forEach((picture, i) => select.add(new Option(picture.alt, i)));
  left.value = 0;
  right.value = Math.min(1, pictures.length - 1);

  const show = () => [left, right].forEach((select, i) => {
    const picture = pictures[select.value];
    images[i].src = picture.src;
    images[i].alt = picture.alt;
    tags[i].textContent = picture.alt;
  });
  const move = () => {
    stage.style.setProperty("--cut", range.value + "%");
    range.setAttribute("aria-valuetext", range.value + " % of " + images[0].alt + ", the rest of " + images[1].alt);
  };
  const follow = event => {
    const box = stage.getBoundingClientRect();
    range.value = Math.round(1000 * Math.min(1, Math.max(0, (event.clientX - box.left) / box.width))) / 10;
    move();
  };
  left.addEventListener("change", () => { show(); move(); });
  right.addEventListener("change", () => { show(); move(); });
  range.addEventListener("input", move);
  stage.addEventListener("pointerdown", event => { stage.setPointerCapture(event.pointerId); follow(event); });
  stage.addEventListener("pointermove", event => { if (event.buttons) follow(event); });
  stage.style.width = Math.max(640, pictures[0].getAttribute("width")) + "px";
  show();
  move();
  viewer.hidden = false;
}
