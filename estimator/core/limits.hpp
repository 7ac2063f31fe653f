#pragma once
// All compile-time capacities of the flight path. Run-time settings may ask for less, never for more. The
// policy of a full capacity is documented where it is applied.

#include <cstddef>

namespace swiftlet {

inline constexpr std::size_t kMaxCameras = 2;
/// Tracked features per frame; observations of a landmark by both cameras count once.
inline constexpr std::size_t kMaxFeatures = 400;
/// IMU samples queued from a sensor to one reader: 10 s at 200 Hz, 2 s at 1 kHz.
inline constexpr std::size_t kImuRing = 2048;
/// Images of one camera queued for tracking, and frames waiting there: about 0.2 s at 20 Hz, the longest
/// usual pause of an operating system without real-time priority.
inline constexpr std::size_t kImageRing = 4;
inline constexpr std::size_t kWaitingFrames = 3;
/// Tracked frames queued for the smoother.
inline constexpr std::size_t kTrackedRing = 4;
/// Images of camera 0 waiting for the mesh: 0.4 s at 20 Hz, longer than tracking and smoothing take.
inline constexpr std::size_t kMeshImages = 8;
/// Keyframes waiting for loop closure: 0.7 s at 6 per second, longer than one takes.
inline constexpr std::size_t kLoopKeyframes = 4;
/// Images of one camera held by the recorder: 0.8 s at 20 Hz, the longest pause of a disk without loss.
inline constexpr std::size_t kRecordedImages = 16;
/// Results queued for the log, which has the lowest priority: 1.6 s at 20 Hz. States at IMU rate: 1 s at 1
/// kHz.
inline constexpr std::size_t kResultRing = 32;
inline constexpr std::size_t kStateRing = 1024;
/// Steps of one stage queued for the recorder.
inline constexpr std::size_t kStepRing = 256;
/// States in the smoother's window, keyframes and recent frames together.
inline constexpr std::size_t kMaxStates = 24;
/// Landmarks in the smoother's window.
inline constexpr std::size_t kMaxLandmarks = 1024;
/// Largest number of landmarks that have their own columns in the system at the same time.
inline constexpr std::size_t kMaxExplicitLandmarks = 64;
/// Planes in the smoother's window.
inline constexpr std::size_t kMaxPlanes = 8;
/// The local mesh has a vertex for each landmark of the window and each new one of a frame, and twice as many
/// faces, as in a closed mesh.
inline constexpr std::size_t kMaxMeshVertices = kMaxLandmarks + kMaxFeatures;
inline constexpr std::size_t kMaxMeshFaces = 2 * kMaxMeshVertices;

}  // namespace swiftlet
