// An autopilot on UDP by node-mavlink, to try a run against an implementation that is not the project's own:
//   npm install node-mavlink mavlink-mappings
//   node listen_as_autopilot.mjs SECONDS [PORT [VEHICLE_PORT]]      # 14550, 14540
//   swiftlet replay LOG --real-time --set autopilot.device=udp:127.0.0.1:14550@14540
// It beats, asks for the time ten times a second, and reads what comes. Each message that was read is written
// again by node-mavlink and compared byte for byte. Prints what came; exit code 1 where something is wrong.
import dgram from 'node:dgram'
import { MavLinkPacketParser, MavLinkPacketSplitter, MavLinkProtocolV2, common, minimal } from 'node-mavlink'

const seconds = Number(process.argv[2])
if (!(seconds > 0)) {
  console.error('usage: node listen_as_autopilot.mjs SECONDS [PORT [VEHICLE_PORT]]')
  process.exit(2)
}
const [port, vehicle_port] = [Number(process.argv[3] ?? 14550), Number(process.argv[4] ?? 14540)]
const kinds = Object.fromEntries(
  [minimal.Heartbeat, common.TimeSync, common.Odometry, common.VisionPositionEstimate, common.ObstacleDistance,
    common.StatusText].map((kind) => [kind.MSG_ID, kind]))

const socket = dgram.createSocket('udp4')
const autopilot = new MavLinkProtocolV2(1, 1)
let sequence = 0
const send = (message) => socket.send(autopilot.serialize(message, sequence++ & 255), vehicle_port, '127.0.0.1')
// Of a clock of its own: an hour after boot.
const begin = process.hrtime.bigint()
const clock = () => process.hrtime.bigint() - begin + 3_600_000_000_000n

const wrong = []
const counts = {}
const texts = []
const asked = new Set()
const offsets = []
const poses = []
const obstacles = []
let bytes_in = 0
let bytes_framed = 0

const splitter = new MavLinkPacketSplitter()
const parser = splitter.pipe(new MavLinkPacketParser())
parser.on('data', (packet) => {
  const now = clock()
  const { msgid, sysid, compid, seq } = packet.header
  const kind = kinds[msgid]
  bytes_framed += packet.buffer.length
  if (!kind) return wrong.push(`message ${msgid} is none that was announced`)
  const name = kind.MSG_NAME
  counts[name] = (counts[name] ?? 0) + 1
  const message = packet.protocol.data(packet.payload, kind)
  const again = new MavLinkProtocolV2(sysid, compid).serialize(message, seq)
  if (!again.equals(packet.buffer)) wrong.push(`${name}: ${packet.buffer.toString('hex')} again ${again.toString('hex')}`)
  if (kind === common.TimeSync && message.tc1 !== 0n) {
    if (!asked.delete(message.ts1)) wrong.push(`TIMESYNC ${message.ts1} was never asked`)
    offsets.push(Number(message.tc1 - (message.ts1 + now) / 2n))
  }
  if (kind === common.Odometry) poses.push({ at: now, message })
  if (kind === common.ObstacleDistance) obstacles.push(message)
  if (kind === common.StatusText) texts.push(`${message.severity}: ${message.text}`)
})
socket.on('message', (bytes) => {
  bytes_in += bytes.length
  splitter.write(bytes)
})

const beat = () => send(Object.assign(new minimal.Heartbeat(), {
  customMode: 0, type: 2, autopilot: 12, baseMode: 81, systemStatus: 3, mavlinkVersion: 3 }))
const ask = () => {
  const ts1 = clock()
  asked.add(ts1)
  send(Object.assign(new common.TimeSync(), { tc1: 0n, ts1, targetSystem: 1, targetComponent: 197 }))
}

const median = (values) => [...values].sort((a, b) => a - b)[values.length >> 1]
socket.bind(port, '127.0.0.1', () => {
  beat()
  const timers = [setInterval(beat, 1000), setInterval(ask, 100)]
  setTimeout(() => {
    timers.forEach(clearInterval)
    socket.close()
    const offset = offsets.length > 0 ? median(offsets) : 0
    const flown = poses.filter((pose) => pose.message.quality > 0)
    // By what TIMESYNC said of the other clock: how old each pose was when it was read here.
    const ages = flown.map((pose) => Number(pose.at) + offset - Number(pose.message.timeUsec) * 1000)
    for (let i = 1; i < flown.length; ++i) {
      if (flown[i].message.timeUsec <= flown[i - 1].message.timeUsec) wrong.push('a pose came twice, or late')
    }
    for (const { message: m } of flown) {
      const norm = Math.hypot(...m.q)
      if (m.frameId !== 20 || m.childFrameId !== 12 || m.estimatorType !== 3) wrong.push('frames of ODOMETRY')
      if (!(Math.abs(norm - 1) < 1e-5)) wrong.push(`a quaternion of length ${norm}`)
    }
    for (const m of obstacles) {
      if (m.frame !== 12 || m.incrementF !== 5 || m.distances.length !== 72) wrong.push('sectors of OBSTACLE_DISTANCE')
      if (m.distances.some((d) => d !== 65535 && (d < m.minDistance || d > m.maxDistance + 1))) {
        wrong.push('a distance that is none')
      }
    }
    if (bytes_in !== bytes_framed) wrong.push(`${bytes_in - bytes_framed} bytes are of no frame`)
    const sectors = obstacles.map((m) => m.distances.filter((d) => d !== 65535).length)
    console.log(JSON.stringify({
      counts, timesync_offsets: offsets.length,
      pose_age_ms: ages.length > 0 ? { median: median(ages) / 1e6, most: Math.max(...ages) / 1e6 } : null,
      resets: flown.length > 0 ? flown.at(-1).message.resetCounter : null,
      known_sectors: sectors.length > 0 ? median(sectors) : null, texts, wrong: wrong.slice(0, 5) }, null, 1))
    process.exit(wrong.length > 0 || Object.keys(counts).length === 0 ? 1 : 0)
  }, 1000 * seconds)
})
