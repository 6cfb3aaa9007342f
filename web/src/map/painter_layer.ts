// An OpenLayers layer with a canvas of its own that a painter paints, each time the map is drawn.

import Layer from "ol/layer/Layer.js";
import type { Frame } from "./frame";

/** A layer named `name` (also the class of its canvas) painted by `paint`. */
export function createPainterLayer(name: string, paint: (frame: Frame) => void): Layer {
  const canvas = document.createElement("canvas");
  canvas.className = `painter painter-${name}`;
  const context = canvas.getContext("2d");
  if (context === null) throw new Error("this browser has no 2D canvas");

  const layer = new Layer({
    render: ({ size, pixelRatio, viewState }) => {
      const [widthPx = 0, heightPx = 0] = size;
      const [x = 0, y = 0] = viewState.center;
      const width = Math.round(widthPx * pixelRatio);
      const height = Math.round(heightPx * pixelRatio);
      // Setting the size clears the canvas too, but also frees and takes its memory.
      if (canvas.width !== width || canvas.height !== height) {
        canvas.width = width;
        canvas.height = height;
      } else {
        context.setTransform(1, 0, 0, 1, 0, 0);
        context.clearRect(0, 0, width, height);
      }
      context.setTransform(pixelRatio, 0, 0, pixelRatio, 0, 0);
      canvas.style.opacity = String(layer.getOpacity());
      paint({ pen: context, widthPx, heightPx, centreLevel: [x, y], resolution: viewState.resolution, pixelRatio });
      return canvas;
    },
  });
  return layer;
}
