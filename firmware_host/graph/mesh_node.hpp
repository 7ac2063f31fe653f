#pragma once
// The node `mesh`: makes meshes and planes from the newest window, its frame and that frame's image.
//
// When it falls behind: it skips to the newest window, counted. A frame whose image is no longer available is
// meshed without intensities, counted.

#include <cstdint>
#include <optional>

#include "firmware_host/graph/graph_options.hpp"
#include "firmware_host/graph/images.hpp"
#include "firmware_host/graph/messages.hpp"
#include "firmware_host/graph/node.hpp"
#include "mesher/mesh_stage.hpp"

namespace swiftlet {

class MeshNode final : public Node {
 public:
  explicit MeshNode(GraphContext& context);

  LatestIn<MeshMessage> window{*this, Arrow::kWakes};
  MeshImageIn image{*this, "camera_0_unmeshed", Arrow::kWaits};  ///< of camera 0
  Out<PlaneReport> planes{*this};
  Out<LocalMesh> newest{*this};
  Out<MeshResult> meshes{*this};  ///< every mesh, on request
  Out<MeshStep> steps{*this};

  bool turn() override;
  void report(RunStatistics& statistics) const override;

 private:
  void meshFrame(const MeshMessage& message);
  void publish(bool keyframe);

  GraphContext& context_;
  MeshStage stage_;
  std::uint64_t window_ = 0;
  std::uint64_t skipped_ = 0;        ///< windows skipped because a newer one was available
  std::uint64_t without_image_ = 0;  ///< steps whose image was no longer available or never arrived
};

}  // namespace swiftlet
