#pragma once
// The newest results of a run for one thread outside the graph (ROS 2 topics, an autopilot, the live view).
// The reader takes them at its own pace; writers never wait for it. Memory: three of each value.

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/newest.hpp"
#include "estimator/messages/local_mesh.hpp"
#include "estimator/messages/odometry_output.hpp"
#include "firmware_host/interfaces/image_feed.hpp"
#include "firmware_host/interfaces/state_news.hpp"
#include "firmware_host/supervisor/verdict.hpp"
#include "mapping/distance/distance_sample.hpp"
#include "mapping/loop/loop_report.hpp"
#include "mapping/surface/surface_patch.hpp"

namespace swiftlet {

/// A frame that was smoothed or waits for initialization.
struct FrameNews {
  Stamp stamp;
  bool has_state = false;
  const char* waiting_for = "";  ///< literal text while initializing
  Health health = Health::kInitializing;
  std::uint32_t epoch = 0;
  FrameStatistics statistics;
  double since_arrival = 0;  ///< from the image's arrival until this was written, on the host's clock [s]
};

/// Vertices of the map's surface, in the map's axes.
struct SurfaceNews {
  static constexpr std::size_t kMost = 200'000;  ///< vertices; further ones are omitted

  SurfaceNews() { vertices.reserve(kMost); }

  Stamp stamp;  ///< of the newest mapped frame
  std::vector<SurfaceVertex> vertices;
};

/// Values of the map's distance field at the vehicle's last mapped position.
struct ObstacleNews {
  Stamp stamp;  ///< of the mapped frame
  SE3 T_map_body;
  DistanceSample nearest;  ///< at the body
};

struct LiveOutlet {
  Newest<StateNews> state;           ///< from `propagate`, at every IMU sample
  Newest<FrameNews> frame;           ///< from `smooth`
  Newest<LocalMesh> mesh;            ///< from `mesh`: mesh over the horizon
  Newest<MapCorrection> correction;  ///< from `loop`
  Newest<SurfaceNews> surface;       ///< from `map`, each time surface_wanted is set
  std::atomic<bool> surface_wanted{false};
  Newest<ObstacleNews> obstacle;      ///< from `map`, for every mapped frame
  Newest<Verdict> verdict;            ///< from the supervisor, ten times a second; readers check its age
  std::unique_ptr<ImageFeed> images;  ///< null: the reader shows no images
};

/// One for each thread that reads results.
using LiveOutlets = FixedVector<LiveOutlet*, 4>;

/// The first image feed among the outlets; null: no reader shows images.
inline ImageFeed* imageFeedOf(const LiveOutlets& outlets) {
  for (LiveOutlet* outlet : outlets) {
    if (outlet->images) return outlet->images.get();
  }
  return nullptr;
}

}  // namespace swiftlet
