// The model in space: three.js on a canvas of its own, drawn when something has changed. Loaded only when it is asked for.

import {
  AmbientLight,
  BufferAttribute,
  BufferGeometry,
  Color,
  DirectionalLight,
  DoubleSide,
  GridHelper,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshLambertMaterial,
  PerspectiveCamera,
  Raycaster,
  Scene,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Library, Objects } from "../editing/objects";
import type { Theme } from "../palette";
import type { ObjectKind } from "../wire";
import { partAt, surfacesOf, type Part, type Surfaces } from "./surfaces";

/** What is drawn. */
export interface SpaceScene {
  objects: Objects;
  library: Library;
  chosen: ReadonlySet<string>;
  unsent: ReadonlyMap<string, unknown>;
  theme: Theme;
}

export interface SpaceView {
  draw: (scene: SpaceScene) => void;
  /** Shows the whole model. */
  fit: () => void;
  dispose: () => void;
}

export interface SpaceViewOptions {
  target: HTMLElement;
  /** An object was clicked on, or nothing. */
  onChoose: (id: string | null, several: boolean) => void;
}

const SOLID: ReadonlySet<ObjectKind> = new Set(["wall", "machine", "furniture", "other", "corridor"]);
const GLASS: ReadonlySet<ObjectKind> = new Set(["doorway"]);
/** How much lighter than the model's colour each kind is, as a share of white. */
const LIGHTER: Readonly<Record<ObjectKind, number>> = { wall: 0.55, machine: 0.25, furniture: 0.4, other: 0.4, corridor: 0.8, doorway: 0.5 };
/** Further than this the pointer has not clicked but turned the view, pixels. */
const CLICK_PX = 4;
const FIELD_DEG = 45;
/** Where the view comes from at first: from the south, a little from the west, and above. */
const FROM = new Vector3(-0.3, -1, 1.5);
/** Cells of the ground's grid, at most each way. */
const GRID_MOST = 200;

/** One mesh of many objects, with its edges. */
interface Layer {
  mesh: Mesh<BufferGeometry, MeshLambertMaterial>;
  lines: LineSegments<BufferGeometry, LineBasicMaterial>;
  parts: readonly Part[];
}

export function createSpaceView({ target, onChoose }: SpaceViewOptions): SpaceView {
  const renderer = new WebGLRenderer({ antialias: true });
  const { domElement: canvas } = renderer;
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "application");
  canvas.setAttribute("aria-label", "The model in space. Drag turns the view, the wheel comes nearer, the right button moves it; a click chooses.");
  target.append(canvas);
  const scene = new Scene();
  const camera = new PerspectiveCamera(FIELD_DEG, 1, 0.05, 5000);
  camera.up.set(0, 0, 1);
  const sun = new DirectionalLight(0xffffff, 1.6);
  sun.position.set(-2, -3, 6);
  const shade = new DirectionalLight(0xffffff, 0.5);
  shade.position.set(4, 2, 3);
  scene.add(new AmbientLight(0xffffff, 1.3), sun, shade);
  const controls = new OrbitControls(camera, canvas);
  controls.maxPolarAngle = Math.PI / 2;

  let layers: Layer[] = [];
  let grid: GridHelper | null = null;
  let drawn: SpaceScene | null = null;
  let isFitted = false;
  let frame = 0;

  const render = (): void => {
    if (frame !== 0) return;
    frame = requestAnimationFrame(() => {
      frame = 0;
      renderer.render(scene, camera);
    });
  };
  controls.addEventListener("change", render);

  const fit = (): void => {
    const box = boundsOf(layers);
    const middle = new Vector3((box.min.x + box.max.x) / 2, (box.min.y + box.max.y) / 2, (box.min.z + box.max.z) / 2);
    const radius = Math.max(3, box.max.distanceTo(box.min) / 2);
    controls.target.copy(middle);
    camera.position.copy(FROM).normalize().multiplyScalar((1.1 * radius) / Math.sin((FIELD_DEG * Math.PI) / 360)).add(middle);
    camera.near = radius / 200;
    camera.far = radius * 40;
    camera.updateProjectionMatrix();
    controls.update();
    render();
  };

  const resize = (): void => {
    const { clientWidth: width, clientHeight: height } = target;
    if (width === 0 || height === 0) return;
    renderer.setPixelRatio(window.devicePixelRatio);
    renderer.setSize(width, height);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    render();
  };
  const watcher = new ResizeObserver(resize);
  watcher.observe(target);

  const build = ({ objects, library, theme }: SpaceScene): void => {
    for (const { mesh, lines } of layers) discard(mesh, lines);
    layers = [layerOf(surfacesOf(objects, library, SOLID), 1), layerOf(surfacesOf(objects, library, GLASS), 0.35)];
    for (const { mesh, lines } of layers) scene.add(mesh, lines);
    const box = boundsOf(layers);
    if (grid !== null) discard(grid);
    const span = Math.max(10, 2 * Math.ceil(Math.max(box.max.x - box.min.x, box.max.y - box.min.y) / 2) + 4);
    grid = new GridHelper(span, Math.min(GRID_MOST, span), new Color(theme.silent), new Color(theme.silent));
    grid.rotateX(Math.PI / 2);
    grid.position.set(Math.round((box.min.x + box.max.x) / 2), Math.round((box.min.y + box.max.y) / 2), -0.005);
    grid.material.transparent = true;
    grid.material.opacity = 0.35;
    scene.add(grid);
    scene.background = new Color(theme.unknown);
  };

  const discard = (...things: (Mesh<BufferGeometry, MeshLambertMaterial> | LineSegments<BufferGeometry, LineBasicMaterial> | GridHelper)[]): void => {
    for (const thing of things) {
      scene.remove(thing);
      thing.geometry.dispose();
      for (const material of [thing.material].flat()) material.dispose();
    }
  };

  const pointerAt = (event: PointerEvent): Vector2 => {
    const box = canvas.getBoundingClientRect();
    return new Vector2(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2);
  };
  const objectAt = (event: PointerEvent): string | null => {
    const ray = new Raycaster();
    ray.setFromCamera(pointerAt(event), camera);
    const [hit] = ray.intersectObjects(layers.map(({ mesh }) => mesh), false);
    const layer = layers.find(({ mesh }) => mesh === hit?.object);
    const face = hit?.faceIndex;
    return layer === undefined || face == null ? null : (partAt(layer.parts, 3 * face)?.id ?? null);
  };
  let pressed: { x: number; y: number } | null = null;
  canvas.addEventListener("pointerdown", ({ clientX: x, clientY: y, button }) => {
    pressed = button === 0 ? { x, y } : null;
  });
  canvas.addEventListener("pointerup", (event) => {
    const moved = pressed === null ? Infinity : Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y);
    pressed = null;
    if (moved <= CLICK_PX) onChoose(objectAt(event), event.shiftKey);
  });

  return {
    draw(next) {
      const before = drawn;
      drawn = next;
      const isOther = before?.objects !== next.objects || before.library !== next.library || before.theme !== next.theme;
      if (isOther) build(next);
      if (isOther || before.chosen !== next.chosen || before.unsent !== next.unsent) {
        for (const layer of layers) colour(layer, next);
      }
      if (!isFitted && next.objects.size > 0) {
        isFitted = true;
        resize();
        fit();
      }
      render();
    },
    fit,
    dispose() {
      watcher.disconnect();
      cancelAnimationFrame(frame);
      controls.dispose();
      for (const { mesh, lines } of layers) discard(mesh, lines);
      if (grid !== null) discard(grid);
      renderer.dispose();
      canvas.remove();
    },
  };
}

function layerOf({ triangles, edges, parts }: Surfaces, opacity: number): Layer {
  const surface = new BufferGeometry();
  surface.setAttribute("position", new BufferAttribute(triangles, 3));
  surface.setAttribute("color", new BufferAttribute(new Float32Array(triangles.length), 3));
  surface.computeBoundingBox();
  const isGlass = opacity < 1;
  const material = new MeshLambertMaterial({ vertexColors: true, side: DoubleSide, flatShading: true, transparent: isGlass, opacity, depthWrite: !isGlass, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
  const outline = new BufferGeometry();
  outline.setAttribute("position", new BufferAttribute(edges, 3));
  outline.setAttribute("color", new BufferAttribute(new Float32Array(edges.length), 3));
  return { mesh: new Mesh(surface, material), lines: new LineSegments(outline, new LineBasicMaterial({ vertexColors: true })), parts };
}

/** Colours each object by its kind, and whether it is chosen or not sent. */
function colour({ mesh, lines, parts }: Layer, { chosen, unsent, theme }: SpaceScene): void {
  const [faces, edges] = [mesh.geometry.getAttribute("color"), lines.geometry.getAttribute("color")];
  const towards = new Color(theme.name === "light" ? "#ffffff" : "#000000");
  const [yellow, paint] = [new Color("#ffc400"), new Color()];
  for (const { id, kind, first, count, firstEdge, edgeCount } of parts) {
    const own = unsent.has(id) ? theme.drawn : theme.model;
    paint.set(own).lerp(towards, LIGHTER[kind]);
    if (chosen.has(id)) paint.copy(yellow);
    for (let n = first; n < first + count; n++) faces.setXYZ(n, paint.r, paint.g, paint.b);
    paint.set(own);
    for (let n = firstEdge; n < firstEdge + edgeCount; n++) edges.setXYZ(n, paint.r, paint.g, paint.b);
  }
  faces.needsUpdate = true;
  edges.needsUpdate = true;
}

function boundsOf(layers: readonly Layer[]): { min: Vector3; max: Vector3 } {
  const [min, max] = [new Vector3(Infinity, Infinity, Infinity), new Vector3(-Infinity, -Infinity, -Infinity)];
  for (const { mesh } of layers) {
    const box = mesh.geometry.boundingBox;
    if (box === null || box.isEmpty()) continue;
    min.min(box.min);
    max.max(box.max);
  }
  return min.x > max.x ? { min: new Vector3(-3, -3, 0), max: new Vector3(3, 3, 0) } : { min, max };
}
