// The cell in 3D, drawn from its figures alone: capsules and drums for the arm, boxes for the hand, discs for the taxels.

import {
  BoxGeometry, BufferAttribute, BufferGeometry, CapsuleGeometry, Color, CylinderGeometry, DirectionalLight, ExtrudeGeometry, Group, HemisphereLight,
  LineBasicMaterial, LineSegments, Matrix4, Mesh, MeshLambertMaterial, PerspectiveCamera, Quaternion, Scene, Shape, SphereGeometry, Vector2, Vector3, WebGLRenderer,
} from "./three-min.js";
import { felt, stageColour, touchColour } from "./paint.js";

const Y = new Vector3(0, 1, 0);
const THICK = [0.066, 0.046]; // m, radii of the first and the last link
const BELOW = 0.008, MARGIN = 0.022; // m, plate below and round the hole's area
const NEAR = 0.006, HIGHER = 0.0006; // m above the plate: the path that is drawn, and the line above what would hide it
const WHOLE = { from: [1.02, -1.2, 0.72], at: [0.3, -0.02, 0.3], field: 42 }; // of the arm, m and degrees
const CLOSE = { from: [0.2, -0.24, 0.07], field: 17 }; // of the fingers, from their middle
const WIDE = 560; // pixels from which both views stand side by side

const paint = (color, opacity = 1) => new MeshLambertMaterial({ color, opacity, transparent: opacity < 1, depthWrite: opacity === 1 });
const SHELL = paint("#e9ecef"), JOINT = paint("#4a545e"), METAL = paint("#9aa3ab", 0.45), PAD = paint("#2b2f34", 0.35), PEG = paint("#e0ab3a"), PLATE = paint("#7f8f9d", 0.5),
  RACK = paint("#53687e"), HOLLOW = paint("#20262c"), BENCH = paint("#b9c1c8"), HOLE = paint("#c0392b", 0.35), LAMP = paint("#2ecc71");

/** A body of a shape along y, moved so that it reaches from one point to another. */
function between(geometry, material, from, to) {
  const body = new Mesh(geometry, material), way = new Vector3().subVectors(to, from);
  body.position.copy(from).addScaledVector(way, 0.5);
  body.quaternion.setFromUnitVectors(Y, way.normalize());
  return body;
}

const point = (x, y, z) => new Vector3(x, y, z);
const capsule = (from, to, radius) => between(new CapsuleGeometry(radius, from.distanceTo(to), 6, 20), SHELL, from, to);
const drum = (radius, half, material, z = 0) => between(new CylinderGeometry(radius, radius, 2 * half, 28), material, point(0, 0, z - half), point(0, 0, z + half));

function box(x, y, z, material, at = [0, 0, 0]) {
  const body = new Mesh(new BoxGeometry(x, y, z), material);
  body.position.set(...at);
  return body;
}

/** A prism along z, from 0 to its height. */
const prism = (outline, height, material) => new Mesh(new ExtrudeGeometry(new Shape(outline.map(([x, y]) => new Vector2(x, y))), { depth: height, bevelEnabled: false }), material);

function group(parent, ...bodies) {
  const made = new Group();
  parent.add(made);
  if (bodies.length) made.add(...bodies);
  return made;
}

export class CellScene {
  constructor(canvas, facts) {
    this.facts = facts;
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setScissorTest(true);
    this.scene = new Scene();
    const sun = new DirectionalLight("#ffffff", 2.2);
    sun.position.set(0.9, -0.9, 2.2);
    this.scene.add(new HemisphereLight("#ffffff", "#8c96a0", 1.7), sun);
    this.fixtures();
    this.arm();
    this.hand();
    const { length, overhang, outline } = facts.peg, size = length + overhang;
    this.peg = prism(outline, size, PEG).translateZ(-size / 2);
    this.held = group(this.scene, this.peg);
    this.held.matrixAutoUpdate = false;
    this.whole = camera(WHOLE.field);
    this.whole.position.set(...WHOLE.from);
    this.whole.lookAt(...WHOLE.at);
    this.close = camera(CLOSE.field);
  }

  fixtures() {
    const { rack, hole } = this.facts, [x, y, z] = hole.centre, [ax, ay] = hole.area, thick = hole.depth + BELOW;
    this.scene.add(box(1.2, 1.1, 0.04, BENCH, [0.32, 0, -0.02]), box(ax + 2 * MARGIN, ay + 2 * MARGIN, thick, PLATE, [x, y, z - thick / 2]));
    const [first, start, height] = rack.first, long = rack.pitch * rack.slots;
    this.scene.add(box(0.044, long + 0.012, height, RACK, [first, start + (long - rack.pitch) / 2, height / 2]));
    for (let slot = 0; slot < rack.slots; slot++) {
      const mouth = drum(0.6 * width(this.facts.peg.outline), 0.0004, HOLLOW);
      mouth.position.set(first, start + rack.pitch * slot, height);
      this.scene.add(mouth);
    }
    const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]].map(([i, j]) => [x + (i * ax) / 2, y + (j * ay) / 2, z + HIGHER]);
    this.area = corners.slice(1).flatMap((corner, n) => [...corners[n], ...corner]);
    this.hole = prism(hole.outline, hole.depth, HOLE);
    this.lamp = new Mesh(new SphereGeometry(0.004), LAMP);
    this.trail = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ vertexColors: true }));
    this.trail.frustumCulled = false;
    this.scene.add(this.hole, this.lamp, this.trail);
  }

  /** Modified Denavit-Hartenberg figures: a along x, twist alpha about x, offset d and the joint's angle about z. */
  arm() {
    const { a, d, alpha, flange } = this.facts.arm;
    let frame = group(this.scene, drum(0.085, 0.04, JOINT, 0.04));
    this.joints = a.map((length, i) => {
      const radius = THICK[0] + ((THICK[1] - THICK[0]) * i) / (a.length - 1), at = point(length, -d[i] * Math.sin(alpha[i]), d[i] * Math.cos(alpha[i]));
      if (length) frame.add(capsule(point(0, 0, 0), point(length, 0, 0), 0.86 * radius));
      if (d[i]) frame.add(capsule(point(length, 0, 0), at, radius));
      const twist = group(frame);
      twist.position.copy(at);
      twist.rotation.x = alpha[i];
      frame = group(twist, drum(1.01 * radius, d[i] ? 0.008 : radius, d[i] ? JOINT : SHELL));
      if (!d[i]) frame.add(drum(0.8 * radius, radius + 0.004, JOINT));
      return frame;
    });
    frame.add(capsule(point(0, 0, 0), point(0, 0, flange - 0.03), 0.9 * THICK[1]), drum(0.042, 0.008, JOINT, flange - 0.008));
    this.flange = group(frame);
    this.flange.position.z = flange;
    this.flange.rotation.z = this.facts.hand.turn;
  }

  /** In the hand's frame z points out of it and y along the closing axis; the finger frame's x is its z, and y its x. */
  hand() {
    const { centre, stroke, pad: [length, across] } = this.facts.hand, base = centre - 0.045, { taxels, fingers } = this.facts;
    this.flange.add(box(0.06, stroke + 0.124, base - 0.006, SHELL, [0, 0, base / 2]), box(0.024, stroke + 0.08, 0.004, JOINT, [0, 0, base]));
    this.discs = [];
    this.fingers = fingers.map((_, finger) => {
      const side = finger ? -1 : 1, tip = length / 2 + 0.003, reach = tip - base + centre;
      const made = group(this.flange, box(across, 0.002, length + 0.004, PAD, [0, side * 0.0015, 0]), box(0.84 * across, 0.008, reach, METAL, [0, side * 0.009, tip - reach / 2]));
      made.position.z = centre;
      this.discs.push(taxels[finger].map(([x, y]) => {
        const disc = new Mesh(new CylinderGeometry(0.0022, 0.0022, 0.0008, 14), paint("#000000"));
        disc.position.set(y, 0, x);
        made.add(disc);
        return disc;
      }));
      return made;
    });
  }

  /** Poses the cell; `peg` is a pose x, y, z, qw, qx, qy, qz, or "held" at the angle theta, or nothing. */
  pose({ joints, width: open, peg, theta, values, hole, isSeated }) {
    joints.forEach((angle, i) => { this.joints[i].rotation.z = angle; });
    this.fingers.forEach((finger, k) => { finger.position.y = (k ? -1 : 1) * (open / 2); });
    this.discs.forEach((discs, finger) => discs.forEach((disc, k) => disc.material.emissive.setRGB(...touchColour(this.facts.colours, felt(this.facts.colours, values[finger][k])).map((part) => part / 255), "srgb")));
    this.scene.updateMatrixWorld();
    this.held.visible = Boolean(peg);
    if (peg === "held") this.held.matrix.multiplyMatrices(this.flange.matrixWorld, this.inHand(theta));
    else if (peg) this.held.matrix.makeRotationFromQuaternion(new Quaternion(peg[4], peg[5], peg[6], peg[3])).setPosition(peg[0], peg[1], peg[2]);
    this.held.matrixWorldNeedsUpdate = true;
    const z = this.facts.hole.centre[2];
    this.hole.visible = Boolean(hole);
    this.lamp.visible = Boolean(hole && isSeated);
    if (hole) {
      this.hole.position.set(hole[0], hole[1], z - this.facts.hole.depth);
      this.lamp.position.set(hole[0], hole[1], z - this.facts.hole.depth - 0.004);
    }
  }

  /** The middle of a peg in the hand: its axis from the end to the finger is -(cos theta, sin theta, 0) of the finger frame. */
  inHand(theta) {
    const { length, overhang } = this.facts.peg, [c, s] = [Math.cos(theta), Math.sin(theta)], way = length - (length + overhang) / 2;
    return new Matrix4().makeBasis(point(0, 1, 0), point(c, 0, -s), point(-s, 0, -c)).setPosition(way * s, 0, this.facts.hand.centre + way * c);
  }

  /** The hole's area, and the tip's path close to the plate, `count` points of the ring, in the colours of the stages. */
  path(ring, count = ring.count) {
    const places = [...this.area], inks = this.area.map(() => 0.06), z = this.facts.hole.centre[2], ink = new Color();
    let before = null;
    for (let n = 0; n < count; n++) {
      const height = -ring.get(n, "depth"), place = height <= NEAR ? [ring.get(n, "x"), ring.get(n, "y"), z + Math.max(height, 0) + HIGHER] : null;
      if (before && place) {
        const colour = ink.set(stageColour(ring.get(n, "stage"))).toArray();
        places.push(...before, ...place);
        inks.push(...colour, ...colour);
      }
      before = place;
    }
    this.trail.geometry.dispose();
    this.trail.geometry = new BufferGeometry();
    this.trail.geometry.setAttribute("position", new BufferAttribute(new Float32Array(places), 3));
    this.trail.geometry.setAttribute("color", new BufferAttribute(new Float32Array(inks), 3));
  }

  /** The whole cell, and the fingers from near: side by side, or one above the other where there is little room. */
  draw() {
    const { clientWidth: across, clientHeight: down } = this.canvas;
    if (!across) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.setSize(across, down, false);
    const middle = this.flange.localToWorld(point(0, 0, this.facts.hand.centre + 0.02));
    this.close.position.copy(middle).add(point(...CLOSE.from));
    this.close.lookAt(middle);
    const isWide = across >= WIDE, [left, top] = isWide ? [Math.round(0.55 * across), down] : [across, Math.round(0.5 * down)];
    this.view(this.whole, 0, isWide ? 0 : down - top, left, top);
    this.view(this.close, isWide ? left : 0, 0, isWide ? across - left : across, isWide ? down : down - top);
  }

  view(eye, left, bottom, across, down) {
    eye.aspect = across / down;
    eye.updateProjectionMatrix();
    this.renderer.setViewport(left, bottom, across, down);
    this.renderer.setScissor(left, bottom, across, down);
    this.renderer.render(this.scene, eye);
  }
}

function camera(field) {
  const made = new PerspectiveCamera(field, 1, 0.02, 10);
  made.up.set(0, 0, 1);
  return made;
}

const width = (outline) => Math.max(...outline.map(([x]) => x)) - Math.min(...outline.map(([x]) => x));
