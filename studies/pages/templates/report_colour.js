// Error maps: CIEDE2000 of each pixel of 8-bit sRGB pictures, and the colours that errors are shown in.
const MAP_TOP = { delta_e: 20, flip: 0.5 }; // errors from here on have the brightest colour
const HEAT = [[0, 0, 4], [59, 15, 112], [140, 41, 129], [222, 73, 104], [254, 159, 109], [252, 253, 191]];

const linear = range(256).map((code) => (code <= 10.31475 ? code / 3294.6 : ((code / 255 + 0.055) / 1.055) ** 2.4));

// CIELAB under D65 of the pixels of an ImageData, three numbers each.
function labOf(pixels) {
  const lab = new Float32Array((pixels.length / 4) * 3);
  const bend = (t) => (t > 216 / 24389 ? Math.cbrt(t) : (t * 24389) / 27 / 116 + 16 / 116);
  for (let from = 0, to = 0; from < pixels.length; from += 4, to += 3) {
    const [r, g, b] = [linear[pixels[from]], linear[pixels[from + 1]], linear[pixels[from + 2]]];
    const x = bend((0.412453 * r + 0.35758 * g + 0.180423 * b) / 0.95047);
    const y = bend(0.212671 * r + 0.71516 * g + 0.072169 * b);
    const z = bend((0.019334 * r + 0.119193 * g + 0.950227 * b) / 1.08883);
    lab[to] = 116 * y - 16;
    lab[to + 1] = 500 * (x - y);
    lab[to + 2] = 200 * (y - z);
  }
  return lab;
}

// CIEDE2000 of two colours that lie in arrays of CIELAB: Sharma, Wu & Dalal, Color Research and Application 30, 2005.
function deltaE(one, other, at) {
  const degrees = Math.PI / 180;
  const chroma = (Math.hypot(one[at + 1], one[at + 2]) + Math.hypot(other[at + 1], other[at + 2])) / 2;
  const grey = 1 + 0.5 * (1 - Math.sqrt(chroma ** 7 / (chroma ** 7 + 25 ** 7)));
  const [a1, a2] = [grey * one[at + 1], grey * other[at + 1]];
  const [c1, c2] = [Math.hypot(a1, one[at + 2]), Math.hypot(a2, other[at + 2])];
  const hue = (b, a) => (Math.atan2(b, a) / degrees + 360) % 360;
  const [h1, h2] = [hue(one[at + 2], a1), hue(other[at + 2], a2)];
  const coloured = c1 * c2 !== 0;
  let turn = coloured ? h2 - h1 : 0;
  if (turn > 180) turn -= 360;
  else if (turn < -180) turn += 360;
  let h = h1 + h2;
  if (coloured) h = (Math.abs(h1 - h2) <= 180 ? h : h < 360 ? h + 360 : h - 360) / 2;
  const [l, c] = [(one[at] + other[at]) / 2, (c1 + c2) / 2];
  const cosine = (factor, angle) => Math.cos((factor * h + angle) * degrees);
  const t = 1 - 0.17 * cosine(1, -30) + 0.24 * cosine(2, 0) + 0.32 * cosine(3, 6) - 0.2 * cosine(4, -63);
  const lightness = (other[at] - one[at]) / (1 + (0.015 * (l - 50) ** 2) / Math.sqrt(20 + (l - 50) ** 2));
  const saturation = (c2 - c1) / (1 + 0.045 * c);
  const tint = (2 * Math.sqrt(c1 * c2) * Math.sin((turn / 2) * degrees)) / (1 + 0.015 * c * t);
  const blue = 60 * Math.exp(-(((h - 275) / 25) ** 2));
  const rotation = -2 * Math.sqrt(c ** 7 / (c ** 7 + 25 ** 7)) * Math.sin(blue * degrees);
  return Math.sqrt(Math.max(0, lightness ** 2 + saturation ** 2 + tint ** 2 + rotation * saturation * tint));
}

// CIEDE2000 between two pictures' pixels, one number a pixel.
function deltaEMap(pixels, truth) {
  const [one, other] = [labOf(pixels), labOf(truth)];
  return new Float32Array(one.length / 3).map((_, at) => deltaE(one, other, 3 * at));
}

// Colour of an error that is this share of the top, from black over violet and red to light yellow.
function heat(share) {
  const along = Math.min(Math.max(share, 0), 1) * (HEAT.length - 1);
  const step = Math.min(Math.floor(along), HEAT.length - 2);
  return HEAT[step].map((from, channel) => from + (along - step) * (HEAT[step + 1][channel] - from));
}

// A canvas with the colours of errors.
function heatCanvas(errors, top, width, height) {
  const canvas = Object.assign(document.createElement("canvas"), { width, height });
  const image = new ImageData(width, height);
  errors.forEach((error, at) => image.data.set([...heat(error / top), 255], 4 * at));
  canvas.getContext("2d").putImageData(image, 0, 0);
  return canvas;
}
