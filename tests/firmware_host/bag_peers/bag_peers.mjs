// Bags beside readers and writers that are not ours: @mcap/core with ROS 2's deserializer, @foxglove/rosbag2 with
// its own definitions over sql.js, and the command lines of sqlite3 and lz4.
//
// usage: node bag_peers.mjs SWIFTLET LOG WORK [RUN]
// LOG is a EuRoC folder; its beginning is exported, read with the others' readers and compared with its files; then written
// again with the others' writers in all that the formats allow, and each of these must export to the same bytes.
// RUN: a run folder, whose messages must all be decoded.
import { McapWriter } from "@mcap/core";
import rosbag2 from "@foxglove/rosbag2";
import zstd from "@foxglove/wasm-zstd";
import initSql from "sql.js";
import assert from "node:assert";
import { execFileSync } from "node:child_process";
import fs from "node:fs";
import path from "node:path";
import { nanoseconds, readMcap, streamMcap } from "./mcap_reader.mjs";

const [swiftlet, whole, work, run] = process.argv.slice(2);
fs.mkdirSync(work, { recursive: true });
const at = (name) => path.join(work, name);

/** The beginning of the log: 1 s of it is written some thirty times. */
function shortened() {
  const log = at("log");
  for (const name of fs.readdirSync(path.join(whole, "mav0"))) {
    const from = path.join(whole, "mav0", name);
    const to = path.join(log, "mav0", name);
    if (!fs.existsSync(path.join(from, "data.csv"))) continue;
    fs.mkdirSync(path.join(to, "data"), { recursive: true });
    const yaml = path.join(from, "sensor.yaml");
    if (fs.existsSync(yaml)) fs.copyFileSync(yaml, path.join(to, "sensor.yaml"));
    const images = name.startsWith("cam");
    const rows = fs.readFileSync(path.join(from, "data.csv"), "utf8").trim().split(/\r?\n/).slice(0, images ? 21 : 501);
    fs.writeFileSync(path.join(to, "data.csv"), rows.join("\n") + "\n");
    if (!images) continue;
    for (const row of rows.slice(1)) {
      const file = row.split(",")[1].trim();
      fs.copyFileSync(path.join(from, "data", file), path.join(to, "data", file));
    }
  }
  return log;
}
const log = shortened();
await zstd.isLoaded;
const program = (...args) => execFileSync(swiftlet, args, { stdio: ["ignore", "ignore", "inherit"] });
const bytesOf = (file) => fs.readFileSync(file);

/** What @foxglove/rosbag2 wants of a database. */
class Database {
  constructor(sql, file) {
    this.db = new sql.Database(bytesOf(file));
    this.topics = this.db.exec("SELECT id, name, type, serialization_format, offered_qos_profiles FROM topics")[0].values;
  }
  async open() {}
  async close() {
    this.db.close();
  }
  async readTopics() {
    return this.topics.map(([, name, type, serializationFormat]) => ({ name, type, serializationFormat, offeredQosProfiles: [] }));
  }
  async *readMessages() {
    const statement = this.db.prepare("SELECT topic_id, CAST(timestamp AS TEXT), data FROM messages ORDER BY timestamp, id");
    while (statement.step()) {
      const [topic, time, data] = statement.get();
      const [, name, type, serializationFormat] = this.topics.find(([id]) => id === topic);
      const ns = BigInt(time);
      const timestamp = { sec: Number(ns / 1000000000n), nsec: Number(ns % 1000000000n) };
      yield { topic: { name, type, serializationFormat, offeredQosProfiles: [] }, timestamp, data };
    }
  }
}

/** Decoded with the definitions of @foxglove/rosbag2, not with ours. */
async function readRosbag2(folder) {
  const text = fs.readFileSync(path.join(folder, "metadata.yaml"), "utf8");
  const name = /relative_file_paths:\n\s*- '(.*)'\n/.exec(text)[1];
  const bag = new rosbag2.Rosbag2([new Database(await initSql(), path.join(folder, name))]);
  await bag.open();
  const messages = [];
  for await (const { topic, timestamp, data, value } of bag.readMessages()) {
    messages.push({ topic: topic.name, type: topic.type, time: nanoseconds(timestamp), data, value });
  }
  await bag.close();
  assert.equal(Number(/message_count: (\d+)/.exec(text)[1]), messages.length, "metadata.yaml counts the messages");
  assert.equal(execFileSync("sqlite3", [path.join(folder, name), "PRAGMA integrity_check"]).toString().trim(), "ok");
  const counted = execFileSync("sqlite3", [path.join(folder, name), "SELECT COUNT(*) FROM messages"]).toString();
  assert.equal(Number(counted), messages.length);
  return messages;
}

/** What the log's own files say, message by message. */
function compareWithLog(messages) {
  const rows = bytesOf(path.join(log, "mav0/imu0/data.csv")).toString().trim().split(/\r?\n/).filter((row) => !row.startsWith("#"));
  const samples = messages.filter((m) => m.topic === "/imu0");
  assert.equal(samples.length, rows.length);
  samples.forEach(({ value, time }, i) => {
    const cells = rows[i].split(",");
    assert.equal(nanoseconds(value.header.stamp), BigInt(cells[0]));
    assert.equal(time, BigInt(cells[0]));
    const { angular_velocity: w, linear_acceleration: a } = value;
    assert.deepEqual([w.x, w.y, w.z, a.x, a.y, a.z], cells.slice(1, 7).map(Number));
    assert.equal(value.orientation_covariance[0], -1);
  });
  let images = 0;
  for (const { topic, value } of messages.filter((m) => m.topic.endsWith("/compressed"))) {
    const folder = path.join(log, "mav0", topic.split("/")[1], "data");
    const stamp = nanoseconds(value.header.stamp);
    const file = [".png", ".jpg"].map((end) => path.join(folder, `${stamp}${end}`)).find((name) => fs.existsSync(name));
    assert(bytesOf(file).equals(Buffer.from(value.data)), file);
    ++images;
  }
  assert.equal(images, messages.filter((m) => m.topic.endsWith("/camera_info")).length);
  assert(images > 0);
  const info = messages.find((m) => m.topic === "/cam0/camera_info").value;
  const yaml = fs.readFileSync(path.join(log, "mav0/cam0/sensor.yaml"), "utf8");
  const [fu, fv, cu, cv] = /intrinsics: *\[([^\]]*)\]/.exec(yaml)[1].split(",").map(Number);
  assert.deepEqual([...info.k], [fu, 0, cu, 0, fv, cv, 0, 0, 1]);
  return { samples: samples.length, images };
}

const same = (a, b) => {
  assert.equal(a.length, b.length);
  a.forEach((message, i) => {
    assert.equal(message.topic, b[i].topic);
    assert.equal(message.type, b[i].type);
    assert.equal(message.time, b[i].time);
    assert(Buffer.from(message.data).equals(Buffer.from(b[i].data)), `${message.topic} at ${message.time}`);
  });
};

/** The messages through @mcap/core's writer. */
async function writeMcap(file, source, reader, options, packing) {
  const parts = [];
  let position = 0n;
  const writable = {
    position: () => position,
    write: async (bytes) => {
      parts.push(Buffer.from(bytes));
      position += BigInt(bytes.length);
    },
  };
  const packers = {
    zstd: (bytes) => zstd.compress(bytes),
    lz4: (bytes) => execFileSync("lz4", ["-c", "-"], { input: bytes, maxBuffer: 1 << 28, stdio: ["pipe", "pipe", "ignore"] }),
  };
  const compressChunk = packing && ((bytes) => ({ compression: packing, compressedData: packers[packing](bytes) }));
  const writer = new McapWriter({ writable, compressChunk, chunkSize: 200000, ...options });
  await writer.start({ profile: "ros2", library: "peer" });
  const channels = new Map();
  let sequence = 0;
  for (const message of source) {
    if (!channels.has(message.topic)) {
      const channel = [...reader.channelsById.values()].find((c) => c.topic === message.topic);
      const { name, encoding, data } = reader.schemasById.get(channel.schemaId);
      const schemaId = await writer.registerSchema({ name, encoding, data });
      channels.set(message.topic, await writer.registerChannel({ topic: channel.topic, messageEncoding: "cdr", schemaId, metadata: new Map() }));
    }
    await writer.addMessage({ channelId: channels.get(message.topic), sequence: sequence++, logTime: message.time, publishTime: message.time, data: message.data });
  }
  await writer.addMetadata({ name: "rosbag2", metadata: new Map([["serialized_metadata", "x"]]) });
  await writer.addAttachment({ name: "notes", logTime: 0n, createTime: 0n, mediaType: "text/plain", data: new Uint8Array(100) });
  await writer.end();
  fs.writeFileSync(file, Buffer.concat(parts));
}

/** The messages through sqlite3's command line, in the tables of a schema. */
function writeDatabase(file, source, schema, packed) {
  const more = (schema >= 2 ? ", offered_qos_profiles TEXT NOT NULL" : "") + (schema >= 4 ? ", type_description_hash TEXT NOT NULL" : "");
  const text = [`CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL${more});`,
    "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL);",
    "CREATE INDEX timestamp_idx ON messages (timestamp ASC);", "BEGIN;"];
  if (schema >= 3) text.unshift("CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);", `INSERT INTO schema VALUES (${schema}, 'x');`);
  const topics = new Map();
  for (const message of source) {
    if (!topics.has(message.topic)) {
      topics.set(message.topic, topics.size + 1);
      text.push(`INSERT INTO topics VALUES (${topics.size}, '${message.topic}', '${message.type}', 'cdr'${schema >= 2 ? ", ''" : ""}${schema >= 4 ? ", ''" : ""});`);
    }
    const data = packed ? zstd.compress(message.data) : Buffer.from(message.data);
    text.push(`INSERT INTO messages(topic_id, timestamp, data) VALUES (${topics.get(message.topic)}, ${message.time}, X'${data.toString("hex")}');`);
  }
  text.push("COMMIT;");
  fs.rmSync(file, { force: true });
  execFileSync("sqlite3", [file], { input: text.join("\n"), maxBuffer: 1 << 28 });
}

/** A folder with what is in it, and the metadata of a version. */
function writeFolder(name, version, file, bytes, messages, mode) {
  const folder = at(name);
  fs.rmSync(folder, { recursive: true, force: true });
  fs.mkdirSync(folder);
  fs.writeFileSync(path.join(folder, file), bytes);
  fs.writeFileSync(path.join(folder, "metadata.yaml"), [
    "rosbag2_bagfile_information:", `  version: ${version}`, "  storage_identifier: sqlite3", "  duration:", "    nanoseconds: 1",
    "  starting_time:", "    nanoseconds_since_epoch: 1", `  message_count: ${messages}`, "  topics_with_message_count: []",
    `  compression_format: "${mode ? "zstd" : ""}"`, `  compression_mode: "${mode ?? ""}"`, "  relative_file_paths:", `    - ${version < 5 ? `${name}/` : ""}${file}`, ""].join("\n"));
  return folder;
}

// What swiftlet writes.
fs.rmSync(at("ours"), { recursive: true, force: true });
program("export", log, "--mcap", at("ours.mcap"), "--rosbag2", at("ours"));
const { messages, reader } = await readMcap(at("ours.mcap"));
assert.equal(streamMcap(at("ours.mcap")), messages.length);
const fromRosbag2 = await readRosbag2(at("ours"));
same(messages, fromRosbag2);
console.log("log:", compareWithLog(messages), compareWithLog(fromRosbag2), "messages:", messages.length);
if (run) {
  fs.rmSync(at("run"), { recursive: true, force: true });
  program("export", run, "--mcap", at("run.mcap"), "--rosbag2", at("run"));
  const ofRun = await readMcap(at("run.mcap"));
  same(ofRun.messages, await readRosbag2(at("run")));
  for (const { value, time } of ofRun.messages) if (value.header) assert.equal(nanoseconds(value.header.stamp), time);
  console.log("run: messages:", ofRun.messages.length, "types:", new Set(ofRun.messages.map((m) => m.type)).size);
}

// What the others write.
let read = 0;
const mustBeSame = (name, bag) => {
  program("export", bag, "--calibration", log, "--mcap", at("again.mcap"));
  assert(bytesOf(at("ours.mcap")).equals(bytesOf(at("again.mcap"))), `${name}: not the same content`);
  ++read;
};
const variants = {
  zstd: [{}, "zstd"],
  lz4: [{}, "lz4"],
  none: [{}],
  unchunked: [{ useChunks: false }],
  without_index: [{ useMessageIndex: false, useChunkIndex: false }, "zstd"],
  without_statistics: [{ useStatistics: false, useSummaryOffsets: false }, "zstd"],
  without_summary: [{ useStatistics: false, useSummaryOffsets: false, repeatSchemas: false, repeatChannels: false, useChunkIndex: false, useMetadataIndex: false, useAttachmentIndex: false }, "lz4"],
};
for (const [name, [options, packing]] of Object.entries(variants)) {
  const file = at(`${name}.mcap`);
  await writeMcap(file, messages, reader, options, packing);
  mustBeSame(name, file);
  // Killed: the footer and what stands before it are lost.
  const bytes = bytesOf(file);
  const summary = Number(new DataView(bytes.buffer, bytes.byteOffset).getBigUint64(bytes.length - 28, true));
  fs.writeFileSync(file, bytes.subarray(0, (summary || bytes.length - 37) - 5));
  mustBeSame(`${name}, unfinished`, file);
  fs.rmSync(file);
}
for (const schema of [1, 2, 3, 4]) {
  const file = at(`schema_${schema}.db3`);
  writeDatabase(file, messages, schema, false);
  mustBeSame(`schema ${schema}`, file);
  for (const version of schema === 3 ? [4, 5, 6, 7, 8, 9] : [4 + schema]) {
    mustBeSame(`metadata ${version}`, writeFolder(`metadata_${version}`, version, "bag_0.db3", bytesOf(file), messages.length));
  }
  if (schema === 4) {
    mustBeSame("packed file", writeFolder("packed", 9, "bag_0.db3.zstd", zstd.compress(bytesOf(file)), messages.length, "FILE"));
    writeDatabase(file, messages, schema, true);
    mustBeSame("packed messages", writeFolder("packed", 9, "bag_0.db3", bytesOf(file), messages.length, "MESSAGE"));
  }
  fs.rmSync(file);
}
console.log("written by others and read back to the same bytes:", read);
