#include "firmware_host/lab/evaluation/evaluate_meshes.hpp"

#include <filesystem>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/open_log.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/lab/evaluation/mesh_frames.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMapFile = "map.ply";

struct Fit {
  Alignment alignment;
  std::string text;
};

Fit fitOf(const Trajectory& estimate, const Trajectory& truth, const AccuracyOptions& options) {
  const Association association = associate(estimate, truth, options.association);
  const TrajectoryError error = trajectoryError(association.pairs, options.align);
  Fit fit;
  if (association.pairs.empty()) {
    fit.text = "nothing (no pose has a true pose at its stamp)";
    return fit;
  }
  fit.alignment = error.alignment;
  fit.text = std::string(alignName(options.align)) + " alignment";
  if (!error.status.ok()) {
    const PosePair& middle = association.pairs[association.pairs.size() / 2];
    fit.alignment = Alignment();
    fit.alignment.T_to_from = middle.truth * middle.estimate.inverse();
    fit.text = "one pose (" + std::string(error.status.what) + ")";
  }
  return fit;
}

/// The run's poses in the frame of its map.ply; empty if that is the odometry's.
Trajectory posesOfMap(const fs::path& run) {
  const auto has = [&](const char* name) {
    std::error_code none;
    return fs::file_size(run / name, none) > 0 && !none;
  };
  if (has("in_map.tum")) return readEstimate(run / "in_map.tum");
  // Full smoothing writes map.tum without loop closure too, after the map was made.
  if (has("loops.csv") && has("map.tum")) return readEstimate(run / "map.tum");
  return {};
}

/// Path of the true surface; empty if unknown.
std::string truthMesh(const MeshEvaluationRequest& request) {
  if (!request.truth_mesh.empty()) return request.truth_mesh;
  const fs::path path = fs::path(request.log) / "truth" / "mesh.ply";
  return fs::exists(path) ? path.string() : std::string();
}

TriangleMesh readTrueMesh(const std::string& file) {
  TriangleMesh mesh = readPly(file);
  if (mesh.faces.empty()) {
    throw InputError(file, 0, "face", "a surface without triangles", "Give a mesh, not points");
  }
  return mesh;
}

/// Judges the frames of meshes/frames.csv.
class SequenceJudge {
 public:
  SequenceJudge(const MeshEvaluationRequest& request, const Trajectory& truth, const AccuracyOptions& options,
                const Alignment& alignment, const TrueSurface* surface)
      : truth_(&truth),
        options_(&options),
        alignment_(&alignment),
        surface_(surface),
        frames_(readMeshFrames((fs::path(request.run) / "meshes").string())) {
    LogOptions log_options;
    log_options.without_images = true;
    const auto log = openLog(request.log, log_options);
    camera_ = log->rig().camera[0];
    T_body_cam_ = log->rig().T_body_cam[0];
  }

  void operator()(MeshAccuracy& accuracy) {
    choose(accuracy);
    const RayGrid grid(camera_, kGridStep);
    MeshSequence frame(surface_, density(&MeshFrame::frame_mesh));
    MeshSequence horizon(surface_, density(&MeshFrame::horizon_mesh));
    for (const Judged& judged : judged_) {
      const MeshFrame& listed = *judged.listed;
      const SeenSurface seen = seenSurface(grid, listed.hull, judged.T_world_body * T_body_cam_,
                                           surface_ == nullptr ? nullptr : &surface_->distance());
      if (!listed.frame_mesh.empty()) frame.add(read(listed.frame_mesh), seen);
      if (!listed.horizon_mesh.empty()) horizon.add(read(listed.horizon_mesh), seen);
    }
    accuracy.frame = frame.result();
    accuracy.horizon = horizon.result();
    if (accuracy.frame->meshes == 0) accuracy.frame.reset();
    if (accuracy.horizon->meshes == 0) accuracy.horizon.reset();
  }

 private:
  struct Judged {
    const MeshFrame* listed = nullptr;
    SE3 T_world_body;  ///< true
  };

  void choose(MeshAccuracy& accuracy) {
    const AssociationOptions& section = options_->association;
    for (const MeshFrame& listed : frames_) {
      if ((section.from && listed.stamp < *section.from) ||
          (section.until && listed.stamp > *section.until)) {
        continue;
      }
      ++accuracy.frames;
      const std::optional<SE3> pose = interpolate(*truth_, listed.stamp, section.max_gap);
      if (!pose) {
        ++accuracy.without_truth;
        continue;
      }
      if (listed.keyframe && listed.frame_mesh.empty()) ++accuracy.keyframes_bare;
      judged_.push_back({&listed, *pose});
    }
  }

  [[nodiscard]] TriangleMesh read(const std::string& path) const { return moved(readPly(path), *alignment_); }

  /// Density for all meshes of a kind, from their total area.
  [[nodiscard]] double density(std::string MeshFrame::*file) const {
    double area = 0;
    for (const Judged& judged : judged_) {
      const std::string& path = judged.listed->*file;
      if (!path.empty()) area += areaOf(read(path));
    }
    return sequenceDensity(area);
  }

  const Trajectory* truth_;
  const AccuracyOptions* options_;
  const Alignment* alignment_;
  const TrueSurface* surface_;
  std::vector<MeshFrame> frames_;
  std::vector<Judged> judged_;
  CameraModel camera_;
  SE3 T_body_cam_;
};

}  // namespace

MeshAccuracy evaluateMeshes(const MeshEvaluationRequest& request, const Trajectory& estimate,
                            const Trajectory& truth, const AccuracyOptions& options) {
  MeshAccuracy accuracy;
  accuracy.truth = truthMesh(request);
  const fs::path run(request.run);
  const bool has_sequence = fs::exists(run / "meshes" / "frames.csv");
  const Fit fit = fitOf(estimate, truth, options);
  const Trajectory map_poses = posesOfMap(run);
  const Fit map_fit = map_poses.empty() ? fit : fitOf(map_poses, truth, options);
  accuracy.alignment = fit.text;
  if (accuracy.truth.empty()) {
    if (!has_sequence) {
      throw InputError(request.log, 0, "", "has no truth/mesh.ply to compare meshes with",
                       "Give the true surface with --truth-mesh");
    }
    SequenceJudge(request, truth, options, fit.alignment, nullptr)(accuracy);
    return accuracy;
  }
  const TriangleMesh true_mesh = readTrueMesh(accuracy.truth);
  const TrueSurface surface(true_mesh);
  if (has_sequence) SequenceJudge(request, truth, options, fit.alignment, &surface)(accuracy);
  const fs::path observed = fs::path(accuracy.truth).parent_path() / "observed.ply";
  const TriangleMesh points = fs::exists(observed) ? readPly(observed) : TriangleMesh();
  const auto judge = [&](const char* name) {
    const bool is_map = std::string_view(name) == kMapFile;
    const TriangleMesh mesh = moved(readPly(run / name), (is_map ? map_fit : fit).alignment);
    CompleteMeshAccuracy judged = completeMeshAccuracy(mesh, surface, points.vertices);
    judged.file = name;
    if (is_map) judgeRegistered(mesh, true_mesh, surface, judged);
    return judged;
  };
  for (const char* name : {"complete_mesh.ply", "local_mesh.ply"}) {
    if (!accuracy.complete && fs::exists(run / name)) accuracy.complete = judge(name);
  }
  if (fs::exists(run / kMapFile)) {
    accuracy.map = judge(kMapFile);
    if (map_fit.text != fit.text) accuracy.alignment += "; the map by " + map_fit.text;
  }
  if (!has_sequence && !accuracy.complete && !accuracy.map) {
    throw InputError(request.run, 0, "", "no meshes in this folder",
                     "Replay with --mesh-sequence or --map, or give a folder written by `swiftlet mesh` or "
                     "`swiftlet fuse`");
  }
  return accuracy;
}

}  // namespace swiftlet
