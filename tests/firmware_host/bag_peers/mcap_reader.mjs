// MCAP files read with @mcap/core and ROS 2's deserializer, as Foxglove reads them.
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { loadDecompressHandlers } from "@mcap/support";
import rosmsg from "@foxglove/rosmsg";
import rosmsg2 from "@foxglove/rosmsg2-serialization";
import assert from "node:assert";
import fs from "node:fs";

const handlers = await loadDecompressHandlers();
export const nanoseconds = ({ sec, nsec, nanosec }) => BigInt(sec) * 1000000000n + BigInt(nsec ?? nanosec);

class Readable {
  constructor(bytes) {
    this.bytes = bytes;
  }
  async size() {
    return BigInt(this.bytes.length);
  }
  async read(offset, length) {
    assert(offset + length <= BigInt(this.bytes.length), "a reader asks for bytes behind the end");
    return new Uint8Array(this.bytes.subarray(Number(offset), Number(offset + length)));
  }
}

/** Every message with its decoded value, by the index of the file. */
export async function readMcap(file) {
  const reader = await McapIndexedReader.Initialize({ readable: new Readable(fs.readFileSync(file)), decompressHandlers: handlers });
  const readers = new Map();
  const messages = [];
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    const channel = reader.channelsById.get(message.channelId);
    const schema = reader.schemasById.get(channel.schemaId);
    assert.equal(channel.messageEncoding, "cdr");
    assert.equal(schema.encoding, "ros2msg");
    if (!readers.has(schema.id)) {
      const definitions = rosmsg.parse(new TextDecoder().decode(schema.data), { ros2: true });
      readers.set(schema.id, new rosmsg2.MessageReader(definitions));
    }
    messages.push({
      topic: channel.topic,
      type: schema.name,
      time: message.logTime,
      data: message.data,
      value: readers.get(schema.id).readMessage(message.data),
    });
  }
  assert.equal(BigInt(messages.length), reader.statistics.messageCount, "the statistics count the messages");
  for (const [id, count] of reader.statistics.channelMessageCounts) {
    const topic = reader.channelsById.get(id).topic;
    assert.equal(BigInt(messages.filter((m) => m.topic === topic).length), count, topic);
  }
  return { messages, reader };
}

/** The same from front to back, without the index. */
export function streamMcap(file) {
  const reader = new McapStreamReader({ decompressHandlers: handlers, validateCrcs: true });
  reader.append(fs.readFileSync(file));
  let messages = 0;
  for (let record; (record = reader.nextRecord()); ) messages += record.type === "Message" ? 1 : 0;
  assert(reader.done(), "the stream reader has seen the end");
  return messages;
}
