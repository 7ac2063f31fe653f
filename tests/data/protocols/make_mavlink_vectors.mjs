// Random MAVLink 2 messages as node-mavlink writes them, for tests/drivers/mavlink:
//   npm install node-mavlink mavlink-mappings && node make_mavlink_vectors.mjs > mavlink_vectors.json
//   node make_mavlink_vectors.mjs vision > mavlink_vision_vectors.json   # what an autopilot is told
// Integers of 64 bits are printed as they are: read them with a parser that keeps them.
import { MavLinkProtocolV2, common, minimal } from 'node-mavlink'

// xorshift32: the same numbers everywhere.
let state = 20240511
const bits = () => {
  state ^= state << 13
  state ^= state >>> 17
  state ^= state << 5
  return state >>> 0
}
const below = (n) => bits() % n
const oneIn = (n) => below(n) === 0
const u8 = () => (oneIn(5) ? 0 : below(256))
const u16 = () => (oneIn(5) ? 0 : below(65536))
const u32 = () => (oneIn(5) ? 0 : bits())
const u64 = () => (oneIn(8) ? 0n : (BigInt(bits() >>> below(32)) << 31n) | BigInt(bits() >>> 1))
const i64 = () => (oneIn(3) ? -u64() : u64())
// Exactly a float32, with zeros often, so that trailing ones are cut.
const f32 = () => (oneIn(4) ? 0 : Math.fround((below(2 ** 24) - 2 ** 23) * 2 ** (below(20) - 26)))
const i16 = () => u16() - 32768
const shorts = () => [i16(), i16(), i16()]
const axes = (v) => ({
  xacc: v.acc[0], yacc: v.acc[1], zacc: v.acc[2], xgyro: v.gyro[0], ygyro: v.gyro[1], zgyro: v.gyro[2],
  xmag: v.mag[0], ymag: v.mag[1], zmag: v.mag[2] })
const vector = () => [f32(), f32(), f32()]
const many = (n, of) => Array.from({ length: n }, of)

const kinds = {
  HIGHRES_IMU: () => {
    const v = {
      time_usec: u64(), acc: vector(), gyro: vector(), mag: vector(), abs_pressure: f32(), diff_pressure: f32(),
      pressure_alt: f32(), temperature: f32(), fields_updated: u16(), id: u8() }
    const m = new common.HighresImu()
    Object.assign(m, {
      timeUsec: v.time_usec, xacc: v.acc[0], yacc: v.acc[1], zacc: v.acc[2], xgyro: v.gyro[0], ygyro: v.gyro[1],
      zgyro: v.gyro[2], xmag: v.mag[0], ymag: v.mag[1], zmag: v.mag[2], absPressure: v.abs_pressure,
      diffPressure: v.diff_pressure, pressureAlt: v.pressure_alt, temperature: v.temperature,
      fieldsUpdated: v.fields_updated, id: v.id })
    return [v, m]
  },
  TIMESYNC: () => {
    const v = { tc1: i64(), ts1: i64(), target_system: u8(), target_component: u8() }
    const m = new common.TimeSync()
    Object.assign(m, { tc1: v.tc1, ts1: v.ts1, targetSystem: v.target_system, targetComponent: v.target_component })
    return [v, m]
  },
  HEARTBEAT: () => {
    const v = {
      custom_mode: u32(), type: u8(), autopilot: u8(), base_mode: u8(), system_status: u8(), mavlink_version: 3 }
    const m = new minimal.Heartbeat()
    Object.assign(m, {
      customMode: v.custom_mode, type: v.type, autopilot: v.autopilot, baseMode: v.base_mode,
      systemStatus: v.system_status, mavlinkVersion: v.mavlink_version })
    return [v, m]
  },
  COMMAND_LONG: () => {
    const v = {
      param: [...vector(), ...vector(), f32()], command: u16(), target_system: u8(), target_component: u8(),
      confirmation: u8() }
    const m = new common.CommandLong()
    v.param.forEach((p, i) => { m['_param' + (i + 1)] = p })
    Object.assign(m, {
      command: v.command, targetSystem: v.target_system, targetComponent: v.target_component,
      confirmation: v.confirmation })
    return [v, m]
  },
  CAMERA_TRIGGER: () => {
    const v = { time_usec: u64(), seq: u32() }
    const m = new common.CameraTrigger()
    Object.assign(m, { timeUsec: v.time_usec, seq: v.seq })
    return [v, m]
  },
  SCALED_IMU: () => {
    const v = { time_boot_ms: u32(), acc: shorts(), gyro: shorts(), mag: shorts(), temperature: i16() }
    const m = new common.ScaledImu()
    Object.assign(m, { timeBootMs: v.time_boot_ms, ...axes(v), temperature: v.temperature })
    return [v, m]
  },
  RAW_IMU: () => {
    const v = { time_usec: u64(), acc: shorts(), gyro: shorts(), mag: shorts(), id: u8(), temperature: i16() }
    const m = new common.RawImu()
    Object.assign(m, { timeUsec: v.time_usec, ...axes(v), id: v.id, temperature: v.temperature })
    return [v, m]
  },
  COMMAND_ACK: () => {
    const v = { command: u16(), result: below(10), progress: u8(), result_param2: bits() | 0, target_system: u8(), target_component: u8() }
    const m = new common.CommandAck()
    Object.assign(m, {
      command: v.command, result: v.result, progress: v.progress, resultParam2: v.result_param2,
      targetSystem: v.target_system, targetComponent: v.target_component })
    return [v, m]
  },
  // A message that this project does not name.
  ATTITUDE: () => {
    const v = { time_boot_ms: u32(), rpy: vector(), rates: vector() }
    const m = new common.Attitude()
    Object.assign(m, {
      timeBootMs: v.time_boot_ms, roll: v.rpy[0], pitch: v.rpy[1], yaw: v.rpy[2], rollspeed: v.rates[0],
      pitchspeed: v.rates[1], yawspeed: v.rates[2] })
    return [v, m]
  },
  ODOMETRY: () => {
    const v = {
      time_usec: u64(), frame: oneIn(2) ? 20 : 1, child: oneIn(2) ? 12 : 20, position: vector(),
      q: [f32(), f32(), f32(), f32()], velocity: vector(), rates: vector(), pose_covariance: many(21, f32),
      velocity_covariance: many(21, f32), reset_counter: u8(), estimator: below(5), quality: below(102) - 1 }
    const m = new common.Odometry()
    Object.assign(m, {
      timeUsec: v.time_usec, frameId: v.frame, childFrameId: v.child, x: v.position[0], y: v.position[1],
      z: v.position[2], q: v.q, vx: v.velocity[0], vy: v.velocity[1], vz: v.velocity[2], rollspeed: v.rates[0],
      pitchspeed: v.rates[1], yawspeed: v.rates[2], poseCovariance: v.pose_covariance,
      velocityCovariance: v.velocity_covariance, resetCounter: v.reset_counter, estimatorType: v.estimator,
      quality: v.quality })
    return [v, m]
  },
  VISION_POSITION_ESTIMATE: () => {
    const v = { usec: u64(), position: vector(), rpy: vector(), covariance: many(21, f32), reset_counter: u8() }
    const m = new common.VisionPositionEstimate()
    Object.assign(m, {
      usec: v.usec, x: v.position[0], y: v.position[1], z: v.position[2], roll: v.rpy[0], pitch: v.rpy[1],
      yaw: v.rpy[2], covariance: v.covariance, resetCounter: v.reset_counter })
    return [v, m]
  },
  OBSTACLE_DISTANCE: () => {
    const v = {
      time_usec: u64(), sensor: below(4), distance_cm: many(72, u16), min_cm: u16(), max_cm: u16(),
      increment_deg: 1 + below(90), offset_deg: f32(), frame: oneIn(2) ? 12 : 20 }
    const m = new common.ObstacleDistance()
    Object.assign(m, {
      timeUsec: v.time_usec, sensorType: v.sensor, distances: v.distance_cm, increment: v.increment_deg,
      minDistance: v.min_cm, maxDistance: v.max_cm, incrementF: v.increment_deg, angleOffset: v.offset_deg,
      frame: v.frame })
    return [v, m]
  },
  STATUSTEXT: () => {
    const text = many(below(50), () => String.fromCharCode(32 + below(95))).join('') + '.'
    // A third in chunks.
    const v = { severity: [2, 3, 4, 6][below(4)], text, ...(oneIn(3) ? { id: 1 + below(65535), chunk: below(4) } : { id: 0, chunk: 0 }) }
    const m = new common.StatusText()
    Object.assign(m, { severity: v.severity, text: v.text, id: v.id, chunkSeq: v.chunk })
    return [v, m]
  },
}
const of_vision = { ODOMETRY: 80, VISION_POSITION_ESTIMATE: 40, OBSTACLE_DISTANCE: 40, STATUSTEXT: 40 }
const counts = process.argv[2] === 'vision' ? of_vision : { HIGHRES_IMU: 120, TIMESYNC: 100, HEARTBEAT: 40, COMMAND_LONG: 60, CAMERA_TRIGGER: 40, ATTITUDE: 20,
  SCALED_IMU: 40, RAW_IMU: 40, COMMAND_ACK: 40 }

const json = (v) => {
  if (typeof v === 'bigint') return v.toString()
  if (Array.isArray(v)) return '[' + v.map(json).join(',') + ']'
  if (typeof v === 'object') return '{' + Object.entries(v).map(([k, x]) => `"${k}":${json(x)}`).join(',') + '}'
  return JSON.stringify(Object.is(v, -0) ? 0 : v)
}
const rows = []
for (const [name, count] of Object.entries(counts)) {
  for (let i = 0; i < count; ++i) {
    const [values, message] = kinds[name]()
    const [system, component, sequence] = [1 + below(255), below(256), below(256)]
    const bytes = new MavLinkProtocolV2(system, component).serialize(message, sequence)
    rows.push(json({
      message: name, id: message.constructor.MSG_ID, extra: message.constructor.MAGIC_NUMBER, system, component,
      sequence, values, hex: bytes.toString('hex') }))
  }
}
console.log('{"generator":"node-mavlink","frames":[\n' + rows.join(',\n') + '\n]}')
