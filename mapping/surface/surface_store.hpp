#pragma once
// The surface of the map for viewers in flight, block by block in fixed memory: of blocks in the volume and
// of dropped ones.
//
// A patch is stored in pages of 240 bytes from a pool and found by its block. A new patch of a block replaces
// the one before. When pages or entries run out, the patches farthest from the vehicle are dropped and
// counted; a new patch that is itself the farthest is dropped at once. Cost: a copy; when full, a pass over
// all entries for every 1/32 of them that is dropped.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "mapping/surface/surface_patch.hpp"
#include "mapping/volume/block_hash.hpp"

namespace swiftlet {

/// Receives patches one by one.
class SurfaceSink {
 public:
  virtual ~SurfaceSink() = default;
  virtual void take(const SurfacePatch& patch) = 0;
};

struct SurfaceStoreCounters {
  std::uint64_t dropped = 0;  ///< patches dropped for lack of room
};

class SurfaceStore {
 public:
  static constexpr std::uint32_t kNone = BlockHash::kNone;

  /// `bytes`: total memory. `block_size` [m]: to compute distances from the vehicle.
  SurfaceStore(std::size_t bytes, double block_size);

  /// Stores a patch; an empty one removes the block's, as takeOut() does.
  void put(const SurfacePatch& patch, const Eigen::Vector3f& vehicle);
  /// Removes the patch of a block.
  void takeOut(const BlockIndex& block);
  void clear();

  /// For readers: entries 0 to entries() - 1, some unused, in an order that depends on the history.
  [[nodiscard]] std::uint32_t entries() const { return static_cast<std::uint32_t>(entries_.size()); }
  [[nodiscard]] std::uint32_t find(const BlockIndex& block) const { return hash_.find(keyOf(block)); }
  /// False for an unused entry.
  bool read(std::uint32_t entry, SurfacePatch& patch) const;
  /// Passes all patches, ordered by block, to `sink`; `patch` is scratch.
  void visit(SurfaceSink& sink, SurfacePatch& patch);

  [[nodiscard]] std::size_t patches() const { return entries_.size() - unused_entries_.size(); }
  [[nodiscard]] std::size_t pagesUsed() const { return next_.size() - free_pages_; }
  [[nodiscard]] std::size_t pages() const { return next_.size(); }
  [[nodiscard]] std::size_t bytes() const;
  [[nodiscard]] const SurfaceStoreCounters& counters() const { return counters_; }

 private:
  static constexpr std::size_t kPageVertices = 12;
  static constexpr std::size_t kPageTriangles = 40;
  struct Page {
    alignas(4) std::array<std::byte, kPageVertices * sizeof(SurfaceVertex)> bytes;
  };
  struct Entry {
    BlockIndex block;
    std::uint32_t first = kNone;  ///< pages: vertices, then triangles
    std::uint16_t vertices = 0;
    std::uint16_t triangles = 0;  ///< 0: unused
    SubmapId submap = 0;
  };
  struct Farness {
    float squared = 0;
    std::uint64_t key = 0;
    std::uint32_t entry = 0;
    bool operator<(const Farness& o) const {
      return squared != o.squared ? squared < o.squared : key < o.key;
    }
  };

  [[nodiscard]] static std::size_t pagesFor(std::size_t vertices, std::size_t triangles);
  [[nodiscard]] Farness farness(const BlockIndex& block, std::uint32_t entry,
                                const Eigen::Vector3f& vehicle) const;
  void remove(std::uint32_t entry);
  bool makeRoom(std::size_t pages, const BlockIndex& block, const Eigen::Vector3f& vehicle);
  void write(const SurfacePatch& patch, Entry& entry);

  float block_size_;
  BlockHash hash_;
  std::vector<Entry> entries_;
  std::vector<std::uint32_t> unused_entries_;
  std::vector<Page> page_;
  std::vector<std::uint32_t> next_;  ///< of each page: the next one of its patch, or of the free list
  std::uint32_t first_free_ = kNone;
  std::size_t free_pages_ = 0;
  std::vector<Farness> far_;  ///< scratch
  SurfaceStoreCounters counters_;
};

}  // namespace swiftlet
