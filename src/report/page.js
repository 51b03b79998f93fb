// Two pictures under one line: light is decoded once, then shown at any exposure.
"use strict";
for (const slider of document.querySelectorAll(".slider")) {
  const width = Number(slider.dataset.width), height = Number(slider.dataset.height);
  const canvas = slider.querySelector("canvas"), context = canvas.getContext("2d");
  const exposure = slider.querySelector("input"), shown = slider.querySelector("output");
  const light = {};
  let split = 0.5;

  // Mantissas stand on the left, the shared exponent on the right.
  const decode = (image) => {
    const copy = document.createElement("canvas");
    copy.width = 2 * width;
    copy.height = height;
    const pen = copy.getContext("2d", { willReadFrequently: true });
    pen.drawImage(image, 0, 0);
    const bytes = pen.getImageData(0, 0, 2 * width, height).data;
    const out = new Float32Array(3 * width * height);
    for (let y = 0; y < height; y++) {
      for (let x = 0; x < width; x++) {
        const from = 4 * (2 * y * width + x), scale = 2 ** (bytes[from + 4 * width] - 128) / 256;
        for (let k = 0; k < 3; k++) out[3 * (y * width + x) + k] = (bytes[from + k] + 0.5) * scale;
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
