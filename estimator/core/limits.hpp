#pragma once
// Every compile-time capacity of the flight path, in one place. Run-time settings may ask for
// less, never for more; each capacity's policy when full is written where it is applied.

#include <cstddef>

namespace swiftlet {

inline constexpr std::size_t kMaxCameras = 2;
/// Tracked features per frame (both cameras of one landmark count once).
inline constexpr std::size_t kMaxFeatures = 400;
/// IMU samples between two frames handed to the smoother: 2.5 s at 400 Hz, 1 s at 1 kHz.
inline constexpr std::size_t kMaxImuPerFrame = 1024;
/// IMU samples on their way from a sensor to one reader: 10 s at 200 Hz, 2 s at 1 kHz.
inline constexpr std::size_t kImuRing = 2048;
/// Images of one camera on their way to tracking, and frames that wait there: some 0.2 s at 20 Hz, the
/// longest pause that an operating system without real-time rights makes now and then.
inline constexpr std::size_t kImageRing = 4;
inline constexpr std::size_t kWaitingFrames = 3;
/// Tracked frames on their way to the smoother.
inline constexpr std::size_t kTrackedRing = 4;
/// Images of camera 0 that wait for the mesh: 0.4 s at 20 Hz, longer than tracking and smoothing take.
inline constexpr std::size_t kMeshImages = 8;
/// Keyframes that wait for loop closure: 0.7 s at 6 a second, longer than it works on one.
inline constexpr std::size_t kLoopKeyframes = 4;
/// Images of one camera that the recorder may hold: 0.8 s at 20 Hz, the longest that a disk may keep it
/// waiting without a loss.
inline constexpr std::size_t kRecordedImages = 16;
/// Results on their way to the log, which is written at the lowest priority: 1.6 s at 20 Hz; and states at
/// IMU rate: 1 s at 1 kHz.
inline constexpr std::size_t kResultRing = 32;
inline constexpr std::size_t kStateRing = 1024;
/// Steps of one stage on their way to the recorder.
inline constexpr std::size_t kStepRing = 256;
/// States in the smoother's window, keyframes and recent frames together.
inline constexpr std::size_t kMaxStates = 24;
/// Landmarks in the smoother's window.
inline constexpr std::size_t kMaxLandmarks = 1024;
/// Of these, landmarks that can have columns of their own in the system at a time.
inline constexpr std::size_t kMaxExplicitLandmarks = 64;
/// Planes in the smoother's window.
inline constexpr std::size_t kMaxPlanes = 8;
/// The local mesh: a vertex for each landmark of the window and a frame's worth of new ones; twice as many
/// faces, as a closed mesh has.
inline constexpr std::size_t kMaxMeshVertices = kMaxLandmarks + kMaxFeatures;
inline constexpr std::size_t kMaxMeshFaces = 2 * kMaxMeshVertices;

}  // namespace swiftlet
