#include "firmware_host/lab/report/kept_frames.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "drivers/input/input_error.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"
#include "firmware_host/smoothing/keyframe_reader.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

template <typename Entry>
const Entry* entryAt(const std::vector<Entry>& entries, Stamp stamp) {
  const auto found = std::ranges::lower_bound(entries, stamp, {}, &Entry::stamp);
  return found != entries.end() && found->stamp == stamp ? &*found : nullptr;
}

void readKeyframes(const std::string& path, KeptFrames& kept, std::vector<MissingFile>& missing) {
  std::ifstream file(path, std::ios::binary);
  KeyframeReader reader(path, file);
  kept.rig = reader.rig();
  for (auto next = reader.next(); next != KeyframeReader::Next::kEnd; next = reader.next()) {
    if (next == KeyframeReader::Next::kRevisit) kept.loops.push_back(reader.revisit());
    if (next != KeyframeReader::Next::kKeyframe) continue;
    const TrackedFrame& frame = reader.frame();
    KeptKeyframe& keyframe = kept.keyframes.emplace_back();
    keyframe.stamp = frame.stamp;
    keyframe.features.assign(frame.features.begin(), frame.features.end());
    std::ranges::sort(keyframe.features, {}, &TrackedFeature::id);
  }
  if (!reader.cut().empty()) missing.push_back({"keyframes.swk", reader.cut()});
}

}  // namespace

const KeptKeyframe* KeptFrames::keyframeAt(Stamp stamp) const { return entryAt(keyframes, stamp); }

const LoopRevisit* KeptFrames::loopAt(Stamp stamp) const {
  const auto found = std::ranges::find(loops, stamp, &LoopRevisit::new_stamp);
  return found == loops.end() ? nullptr : &*found;
}

std::optional<TriangleMesh> KeptFrames::meshAt(Stamp stamp) const {
  const MeshFrame* frame = entryAt(meshes, stamp);
  if (frame == nullptr || frame->frame_mesh.empty()) return {};
  return readPly(frame->frame_mesh);
}

KeptFrames readKeptFrames(const std::string& run_folder, std::vector<MissingFile>& missing) {
  KeptFrames kept;
  const fs::path folder(run_folder);
  const auto read = [&](const char* name, const auto& reader) {
    if (!fs::exists(folder / name)) return;
    try {
      reader((folder / name).string());
    } catch (const InputError& error) {
      missing.push_back({name, error.what()});
    }
  };
  read("keyframes.swk", [&](const std::string& path) { readKeyframes(path, kept, missing); });
  read("meshes/frames.csv",
       [&](const std::string& path) { kept.meshes = readMeshFrames(fs::path(path).parent_path().string()); });
  return kept;
}

}  // namespace swiftlet
