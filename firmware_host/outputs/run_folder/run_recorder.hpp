#pragma once
// Writes the files of a run folder that grow during the run: odometry.tum; on request imu_rate.tum with
// imu_rate_health.csv (a line for each change of health or epoch of those states) and meshes/; states.csv and
// events.log. At the end: local_mesh.ply, map.ply and map.glb. Lines are written as they arrive, in constant
// memory. A file that can no longer be written ends there and is reported once by name; the others continue.

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "firmware_host/files/line_file.hpp"
#include "firmware_host/files/lost_files.hpp"
#include "firmware_host/interfaces/run_listener.hpp"
#include "firmware_host/outputs/map_files/block_file.hpp"
#include "firmware_host/outputs/map_files/kept_folder.hpp"
#include "firmware_host/outputs/map_files/mesh_files.hpp"
#include "firmware_host/outputs/run_folder/in_map_file.hpp"

namespace swiftlet {

class RunRecorder : public RunListener {
 public:
  struct Wanted {
    bool imu_rate = false;
    bool meshes = false;
    bool in_map = false;        ///< in_map.tum
    std::string keep_map = "";  ///< folder of the map to keep; empty: none
    /// Also continue without a file that cannot be created; otherwise InputError.
    bool fly_on = false;
  };
  /// The folder must exist; empty: nothing is written. `lost` outlives this object and receives what cannot
  /// be written.
  RunRecorder(const std::string& folder, const Wanted& wanted, LostFiles& lost);

  void onFrame(const TrackedFrame& tracked, const OdometryOutput& output) override;
  void onImuState(const NavState& state) override;
  void onMesh(bool keyframe, const LocalMesh& frame, const LocalMesh* horizon,
              std::span<const Eigen::Vector2f> hull) override;
  void onLocalMesh(const LocalMesh& mesh) override;
  void onLoop(const LoopReport& report) override;
  void onPlaces(LoopStage& places) override;
  void onMap(MapStage& map, std::span<const std::uint32_t> tied) override;
  void onFinish(const OdometryOutput& output) override;
  void onRemark(Stamp stamp, const std::string& text) override;
  /// For the graph: storage of map blocks that do not fit in memory.
  [[nodiscard]] BlockFile& storage() { return storage_; }
  /// Makes the kept map appear under its name.
  void commitMap();
  /// Summary of the map and its surface; null without a map.
  [[nodiscard]] const nlohmann::ordered_json& map() const { return map_; }

 private:
  template <typename File, typename... Arguments>
  void open(std::optional<File>& file, Arguments&&... arguments);
  template <typename File, typename Write>
  void writeTo(std::optional<File>& file, const Write& write);
  template <typename Write>
  void attempt(const Write& write);
  void writeEvents(const OdometryOutput& output);
  void writeKeyframes(const OdometryOutput& output);

  std::string folder_;
  Wanted wanted_;
  LostFiles& lost_;
  std::optional<LineFile> odometry_;
  std::optional<LineFile> imu_rate_;
  std::optional<LineFile> imu_rate_health_;
  std::optional<Health> health_;  ///< of the newest line in imu_rate_health_
  std::uint32_t epoch_ = 0;       ///< of the newest line in imu_rate_health_
  std::optional<LineFile> states_;
  std::optional<LineFile> events_;
  std::optional<InMapFile> in_map_;
  std::optional<KeptFolder> kept_;
  std::vector<std::uint32_t> kept_epochs_;
  std::optional<MeshSequenceWriter> meshes_;
  BlockFile storage_;
  nlohmann::ordered_json map_;
};

}  // namespace swiftlet
