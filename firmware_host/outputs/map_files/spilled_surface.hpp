#pragma once
// Surface for which the map's store has no room any more: what lies farthest from the vehicle, and the
// submaps of epochs that are over. On disk, in a file of the run folder without a name (it is unlinked as it
// is opened), so nothing is left behind.
//
// Host side, of the thread `map`, then of whoever writes the mesh. Memory: a fixed buffer, and 4 bytes a
// submap. Errors: a file that cannot be made or written loses the patch, counted; the flight goes on.

#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "mapping/surface/surface_store.hpp"

namespace swiftlet {

class SpilledSurface : public SurfaceSink {
 public:
  /// The file is made in `folder`, with the first patch. Empty: no file, every patch is lost.
  explicit SpilledSurface(std::string folder) : folder_(std::move(folder)) {}

  void take(const SurfacePatch& patch) override;
  void beginSubmap(std::uint32_t epoch) override { submap_ = epoch; }

  /// Epochs of which there are patches, ascending.
  [[nodiscard]] const std::vector<std::uint32_t>& submaps() const { return submaps_; }
  /// The patches of a submap in the order in which they came: of one block the last counts. Those after a
  /// place that cannot be read are lost, counted.
  void visit(std::uint32_t submap, SurfaceSink& to);
  [[nodiscard]] std::uint64_t lost() const { return lost_; }

 private:
  struct Head {
    std::uint32_t submap = 0;
    BlockIndex block;
    std::uint32_t vertices = 0;
    std::uint32_t triangles = 0;
  };
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };

  bool open();

  std::string folder_;
  std::unique_ptr<std::FILE, Close> file_;
  bool failed_ = false;
  std::uint32_t submap_ = 0;
  std::vector<std::uint32_t> submaps_;
  std::uint64_t written_ = 0;
  std::uint64_t lost_ = 0;
  SurfacePatch patch_;
};

}  // namespace swiftlet
