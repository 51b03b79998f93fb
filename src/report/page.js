// Two pictures under one line: light is decoded once, then shown at any exposure.
"use strict";
for (const slider of document.querySelectorAll(".slider")) {
  const width = Number(slider.dataset.width), height = Number(slider.dataset.height);
  const canvas = slider.querySelector("canvas"), context = canvas.getContext("2d");
  const exposure = slider.querySelector("input"), shown = slider.querySelector("output");
  const light = {};
  let split = 0.5;

  // The logarithm of the light, the share of red in it, and that of blue, side by side.
  const decode = (image) => {
    const copy = document.createElement("canvas"), end = Number(image.dataset.end), levels = 255 / Number(image.dataset.range);
    const shares = Number(image.dataset.shares);
    copy.width = 3 * width;
    copy.height = height;
    const pen = copy.getContext("2d", { willReadFrequently: true });
    pen.drawImage(image, 0, 0);
    const bytes = pen.getImageData(0, 0, 3 * width, height).data;
    const out = new Float32Array(3 * width * height);
    for (let y = 0; y < height; y++) {
      for (let x = 0; x < width; x++) {
        const from = 4 * (3 * y * width + x), to = 3 * (y * width + x), level = bytes[from];
        const light = level > 0 ? 2 ** (end + (level - 255) / levels) : 0;
        const red = bytes[from + 4 * width] / shares, blue = bytes[from + 8 * width] / shares;
        out[to] = light * red;
        out[to + 1] = light * Math.max(0, 1 - red - blue);
        out[to + 2] = light * blue;
      }
    }
    return out;
  };
  const encode = (v) => 255 * (v <= 0.0031308 ? 12.92 * v : v < 1 ? 1.055 * v ** (1 / 2.4) - 0.055 : 1);
  const draw = () => {
    if (!light.a || !light.b) return;
    const picture = context.createImageData(width, height), gain = 2 ** Number(exposure.value);
    const line = Math.round(split * width);
    for (let y = 0; y < height; y++) {
      for (let x = 0; x < width; x++) {
        const source = x < line ? light.a : light.b, i = y * width + x;
        for (let k = 0; k < 3; k++) picture.data[4 * i + k] = encode(gain * source[3 * i + k]);
        picture.data[4 * i + 3] = 255;
      }
      if (line > 0 && line < width) picture.data.fill(255, 4 * (y * width + line), 4 * (y * width + line) + 3);
    }
    context.putImageData(picture, 0, 0);
  };
  for (const image of slider.querySelectorAll("img.source")) {
    image.decode().then(() => {
      light[image.dataset.side] = decode(image);
      draw();
    });
  }
  canvas.addEventListener("pointermove", (event) => {
    const box = canvas.getBoundingClientRect();
    split = Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
    draw();
  });
  exposure.addEventListener("input", () => {
    shown.textContent = exposure.value;
    draw();
  });
}
