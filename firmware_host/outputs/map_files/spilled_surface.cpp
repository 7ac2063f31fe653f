#include "firmware_host/outputs/map_files/spilled_surface.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>

namespace swiftlet {

bool SpilledSurface::open() {
  if (file_ || failed_) return !failed_;
  const std::string path = folder_ + "/surface.tmp";
  const int file = folder_.empty() ? -1 : ::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  failed_ = file < 0;
  if (failed_) return false;
  unlink(path.c_str());
  file_.reset(fdopen(file, "w+b"));
  return true;
}

void SpilledSurface::take(const SurfacePatch& patch) {
  const Head head{submap_, patch.block, static_cast<std::uint32_t>(patch.vertices.size()),
                  static_cast<std::uint32_t>(patch.triangles.size())};
  const auto put = [&](const void* data, std::size_t size, std::size_t count) {
    return std::fwrite(data, size, count, file_.get()) == count;
  };
  failed_ = !open() || !put(&head, sizeof(head), 1) ||
            !put(patch.vertices.data(), sizeof(SurfaceVertex), patch.vertices.size()) ||
            !put(patch.triangles.data(), sizeof(SurfaceTriangle), patch.triangles.size());
  if (failed_) {
    ++lost_;
    return;
  }
  ++written_;
  const auto at = std::ranges::lower_bound(submaps_, submap_);
  if (at == submaps_.end() || *at != submap_) submaps_.insert(at, submap_);
}

void SpilledSurface::visit(std::uint32_t submap, SurfaceSink& to) {
  if (!file_ || std::fflush(file_.get()) != 0 || std::fseek(file_.get(), 0, SEEK_SET) != 0) return;
  const auto get = [&](void* data, std::size_t size, std::size_t count) {
    return std::fread(data, size, count, file_.get()) == count;
  };
  for (std::uint64_t i = 0; i < written_; ++i) {
    Head head;
    patch_.vertices.clear();
    patch_.triangles.clear();
    bool whole = get(&head, sizeof(head), 1) && head.vertices <= kMostPatchVertices &&
                 head.triangles <= kMostPatchTriangles;
    for (std::uint32_t k = 0; whole && k < head.vertices; ++k) {
      SurfaceVertex vertex;
      whole = get(&vertex, sizeof(vertex), 1) && patch_.vertices.tryPushBack(vertex);
    }
    for (std::uint32_t k = 0; whole && k < head.triangles; ++k) {
      SurfaceTriangle triangle;
      whole = get(&triangle, sizeof(triangle), 1) && patch_.triangles.tryPushBack(triangle);
    }
    if (!whole) {
      lost_ += written_ - i;
      written_ = i;
      break;
    }
    patch_.block = head.block;
    if (head.submap == submap) to.take(patch_);
  }
  std::fseek(file_.get(), 0, SEEK_END);
}

}  // namespace swiftlet
