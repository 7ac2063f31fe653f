// A run's MCAP file as Foxglove meets it: schemas beside those of ROS 2 Humble, counts and stamps beside the run folder's
// files, values beside each other, one tree of frames, and the layout that swiftlet installs on what the file holds.
//
// usage: node foxglove_run.mjs SWIFTLET LAYOUT LOG RUN WORK
// RUN was replayed from LOG, a EuRoC folder with images, with --map and --mesh-sequence.
import rosmsg from "@foxglove/rosmsg";
import common from "@foxglove/rosmsg-msgs-common";
import assert from "node:assert";
import { execFileSync } from "node:child_process";
import fs from "node:fs";
import path from "node:path";
import { nanoseconds, readMcap, streamMcap } from "./mcap_reader.mjs";

const [swiftlet, layoutFile, log, run, work] = process.argv.slice(2);
fs.mkdirSync(work, { recursive: true });
const program = (...args) => execFileSync(swiftlet, args, { stdio: ["ignore", "ignore", "inherit"] });
const rowsOf = (...file) => fs.readFileSync(path.join(...file), "utf8").trim().split(/\r?\n/).filter((row) => !row.startsWith("#"));

const file = path.join(work, "foxglove.mcap");
const again = path.join(work, "again.mcap");
for (const name of [file, again]) program("export", run, "--mcap", name, "--images", "--jpeg", "80");
assert(fs.readFileSync(file).equals(fs.readFileSync(again)), "the same run gives the same bytes");
const { messages, reader } = await readMcap(file);
assert.equal(streamMcap(file), messages.length);
const of = (topic) => messages.filter((m) => m.topic === topic).map((m) => m.value);

/** The fields of a definition and of all that it is made of, by type, as text. */
function fieldsOf(definitions, root) {
  const byName = new Map(definitions.map((d) => [d.name ?? root, d]));
  const text = {};
  for (const [name, { definitions: fields }] of byName) {
    text[name] = fields.filter((f) => !f.isConstant).map((f) => `${f.type}${f.isArray ? `[${f.arrayLength ?? ""}]` : ""} ${f.name}`);
  }
  return text;
}
const short = (type) => type.replace("/msg/", "/");
for (const schema of reader.schemasById.values()) {
  const root = short(schema.name);
  for (const [type, fields] of Object.entries(fieldsOf(rosmsg.parse(new TextDecoder().decode(schema.data), { ros2: true }), root))) {
    const theirs = common.ros2humble[short(type)];
    assert(theirs, `${type} is a type of ROS 2`);
    assert.deepEqual(fields, fieldsOf([theirs], type)[theirs.name], type);
  }
}

// Types and counts: topic, type, messages as the run's and the log's files have rows.
const images = (camera) => rowsOf(log, "mav0", `cam${camera}`, "data.csv").length;
const poses = rowsOf(run, "odometry.tum").length;
const keyframes = rowsOf(run, "states.csv").length;
const meshes = fs.readdirSync(path.join(run, "meshes"));
const horizons = rowsOf(run, "meshes", "frames.csv").length;
assert(meshes.length > 0 && horizons > 0);
const expected = {
  "/cam0/image_raw/compressed": ["sensor_msgs/CompressedImage", images(0)],
  "/cam1/image_raw/compressed": ["sensor_msgs/CompressedImage", images(1)],
  "/cam0/camera_info": ["sensor_msgs/CameraInfo", images(0)],
  "/cam1/camera_info": ["sensor_msgs/CameraInfo", images(1)],
  "/imu0": ["sensor_msgs/Imu", rowsOf(log, "mav0", "imu0", "data.csv").length],
  "/tf": ["tf2_msgs/TFMessage", poses],
  "/tf_static": ["tf2_msgs/TFMessage", 1],
  "/swiftlet/pose": ["geometry_msgs/PoseStamped", poses],
  "/swiftlet/path": ["nav_msgs/Path", 1],
  "/swiftlet/map_path": ["nav_msgs/Path", 1],
  "/swiftlet/map_mesh": ["visualization_msgs/Marker", 1],
  "/swiftlet/map_points": ["sensor_msgs/PointCloud2", 1],
  "/truth/path": ["nav_msgs/Path", 1],
  "/swiftlet/odometry": ["nav_msgs/Odometry", keyframes],
};
for (const name of ["velocity", "bias_gyro", "bias_accel", "sigma_attitude", "sigma_position", "sigma_velocity"]) {
  expected[`/swiftlet/${name}`] = ["geometry_msgs/Vector3Stamped", keyframes];
}
for (const name of ["health", "tracks", "reprojection_rms", "imu_residual"]) expected[`/swiftlet/${name}`] = ["std_msgs/Float64", keyframes];
for (const [topic, [type, count]] of Object.entries(expected)) {
  const found = messages.filter((m) => m.topic === topic);
  assert.equal(found.length, count, topic);
  assert.equal(short(found[0].type), type, topic);
}

// Stamps: that of the header is that of the message, and the file is in the order of the stamps.
let stamped = 0;
for (const { value, time, topic } of messages) {
  const header = value.header ?? value.transforms?.[0]?.header;
  if (!header) continue;
  assert.equal(nanoseconds(header.stamp), time, topic);
  ++stamped;
}
const times = messages.map((m) => m.time);
assert(times.every((time, i) => i === 0 || time >= times[i - 1]));
const rows = rowsOf(run, "odometry.tum").map((row) => row.split(" ")[0].replace(".", ""));
assert.deepEqual(messages.filter((m) => m.topic === "/swiftlet/pose").map((m) => String(m.time)), rows);

// Images: whole JPEG files, as many bytes as their headers want.
for (const { format, data } of of("/cam0/image_raw/compressed")) {
  assert.equal(format, "jpeg");
  assert.deepEqual([data[0], data[1], data.at(-2), data.at(-1)], [0xff, 0xd8, 0xff, 0xd9]);
}

// The map's points are the corners of its mesh, in the mesh's colours.
const cloud = of("/swiftlet/map_points")[0];
const mesh = of("/swiftlet/map_mesh")[0];
assert.deepEqual(cloud.fields.map((f) => f.name), ["x", "y", "z", "rgb", "label"]);
assert.equal(cloud.data.length, cloud.width * cloud.point_step);
assert.equal(cloud.row_step, cloud.data.length);
const view = new DataView(cloud.data.buffer, cloud.data.byteOffset, cloud.data.length);
const points = new Map();
for (let i = 0; i < cloud.width; ++i) {
  const at = i * cloud.point_step;
  points.set([0, 4, 8].map((o) => view.getFloat32(at + o, true)).join(), view.getUint32(at + 12, true));
}
mesh.points.forEach(({ x, y, z }, i) => {
  const rgb = points.get([x, y, z].join());
  assert(rgb !== undefined, "a corner of the mesh that is no point");
  const { r, g, b } = mesh.colors[i];
  assert.equal(rgb, (Math.round(r * 255) << 16) | (Math.round(g * 255) << 8) | Math.round(b * 255));
});
assert(mesh.points.length > 1000);

// What is plotted is what the odometry's message says.
const near = (a, b, what) => assert(Math.abs(a - b) <= 1e-9 * Math.max(1, Math.abs(b)), `${what}: ${a} and ${b}`);
const levels = messages.filter((m) => m.topic === "/diagnostics" && m.value.status[0].name === "swiftlet/keyframe").map((m) => m.value.status[0].level);
of("/swiftlet/odometry").forEach(({ pose, twist }, i) => {
  const { x, y, z, w } = pose.pose.orientation;
  const v = twist.twist.linear;
  const c = [y * v.z - z * v.y + w * v.x, z * v.x - x * v.z + w * v.y, x * v.y - y * v.x + w * v.z];
  const world = [v.x + 2 * (y * c[2] - z * c[1]), v.y + 2 * (z * c[0] - x * c[2]), v.z + 2 * (x * c[1] - y * c[0])];
  const velocity = of("/swiftlet/velocity")[i].vector;
  const sigma = of("/swiftlet/sigma_position")[i].vector;
  ["x", "y", "z"].forEach((axis, k) => {
    near(velocity[axis], world[k], `velocity ${axis}`);
    near(sigma[axis] ** 2, pose.covariance[7 * k], `variance ${axis}`);
    assert(of("/swiftlet/sigma_velocity")[i].vector[axis] > 0);
  });
  const attitude = of("/swiftlet/sigma_attitude")[i].vector;
  near(attitude.x ** 2 + attitude.y ** 2 + attitude.z ** 2, pose.covariance[21] + pose.covariance[28] + pose.covariance[35], "attitude");
  assert.equal(of("/swiftlet/health")[i].data, levels[i]);
});

// Every frame that a message names hangs on `map`.
const parents = new Map();
for (const { transforms } of [...of("/tf_static"), ...of("/tf")]) for (const t of transforms) parents.set(t.child_frame_id, t.header.frame_id);
const rootOf = (frame) => (parents.has(frame) ? rootOf(parents.get(frame)) : frame);
for (const { topic, value } of messages) {
  const frame = value.header?.frame_id;
  if (frame && topic !== "/imu0") assert.equal(rootOf(frame), "map", `${topic}: ${frame}`);
}

// The layout: each panel stands in it once, each topic is in the file, each path gives numbers or, of states, words.
const layout = JSON.parse(fs.readFileSync(layoutFile, "utf8"));
const panels = [];
(function walk(node) {
  if (typeof node !== "string") return node && [node.first, node.second].forEach(walk);
  panels.push(node);
  for (const tab of layout.configById[node]?.tabs ?? []) walk(tab.layout);
})(layout.layout);
assert.deepEqual(panels.toSorted(), Object.keys(layout.configById).toSorted());
const topics = new Set();
let paths = 0;
for (const [panel, config] of Object.entries(layout.configById)) {
  Object.keys(config.topics ?? {}).forEach((topic) => topics.add(topic));
  Object.values(config.imageMode ?? {}).forEach((topic) => topics.add(topic));
  if (config.topicToRender) topics.add(config.topicToRender);
  for (const name of Object.keys(config.transforms ?? {})) assert(parents.has(name.replace(/^frame:/, "")), name);
  if (config.followTf) assert.equal(config.followTf, rootOf("cam0"));
  for (const { value } of config.paths ?? []) {
    const [, topic, fields] = /^([^.]+)\.(.+)$/.exec(value);
    topics.add(topic);
    for (const message of of(topic)) {
      const found = fields.split(".").reduce((at, field) => {
        const [, name, index] = /^(\w+)(?:\[(\d+)\])?$/.exec(field);
        return index === undefined ? at?.[name] : at?.[name]?.[Number(index)];
      }, message);
      assert(panel.startsWith("Plot!") ? Number.isFinite(found) : typeof found === "string", `${value}: ${found}`);
    }
    ++paths;
  }
}
for (const topic of topics) assert(of(topic).length > 0, `the layout shows ${topic}, which the file does not hold`);
console.log("foxglove: messages:", messages.length, "stamped:", stamped, "types:", reader.schemasById.size, "panels:", panels.length, "topics shown:", topics.size, "paths:", paths);
