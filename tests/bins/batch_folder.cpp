#include "tests/bins/batch_folder.h"

#include <algorithm>
#include <cstring>
#include <filesystem>

#include "engine/image_diff.h"
#include "io/image.h"

namespace shoal::testing {
namespace {

namespace stdfs = std::filesystem;

/// Files below the folder, from there.
std::vector<std::string> files_in(const std::string& folder) {
  std::vector<std::string> files;
  std::error_code error;
  for (stdfs::recursive_directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    if (at->is_regular_file(error)) files.push_back(stdfs::path(at->path()).lexically_relative(folder).string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::string number_bytes(uint32_t number) { return {reinterpret_cast<const char*>(&number), sizeof number}; }

/// A .glb of a .gltf with one buffer.
std::string glb_of(nlohmann::json json, std::string binary) {
  json["buffers"][0].erase("uri");
  std::string text = json.dump();
  while (text.size() % 4 != 0) text += ' ';
  while (binary.size() % 4 != 0) binary += '\0';
  const auto total = static_cast<uint32_t>(12 + 8 + text.size() + 8 + binary.size());
  return "glTF" + number_bytes(2) + number_bytes(total) + number_bytes(static_cast<uint32_t>(text.size())) + "JSON" + text +
         number_bytes(static_cast<uint32_t>(binary.size())) + std::string("BIN\0", 4) + binary;
}

}  // namespace

BatchFolder::BatchFolder() {
  add_scene("one.gltf", 1);
  add_scene("two words.gltf", 2);
  add_scene("deep/er/three.gltf", 3);
}

void BatchFolder::add_scene(const std::string& name, float size, bool binary) const {
  WrittenScene scene;
  scene.add_node({{"mesh", scene.add_triangle_mesh(0, size)}});
  const std::string made = folder / "made";
  save(scene, made);
  nlohmann::json json = nlohmann::json::parse(file_text(made + "/scene.gltf"));
  const std::string path = scenes() + "/" + name, bytes = file_text(made + "/scene.bin");
  stdfs::remove_all(made);
  if (binary) return put_file(path, glb_of(json, bytes));
  const std::string buffer = "buffer" + std::to_string(static_cast<int>(size * 100)) + ".bin";
  json["buffers"][0]["uri"] = buffer;
  put_file((stdfs::path(path).parent_path() / buffer).string(), bytes);
  put_file(path, json.dump());
}

std::vector<std::string> BatchFolder::command(const std::vector<std::string>& more) const {
  return join(join({"batch", scenes(), "--out", out()}, tiny_picture()), more);
}

nlohmann::json BatchFolder::summary() const {
  nlohmann::json json = nlohmann::json::parse(file_text(out("/summary.json")), nullptr, false);
  EXPECT_TRUE(json.is_object()) << "no summary";
  return json;
}

nlohmann::json BatchFolder::entry(const std::string& scene) const {
  const nlohmann::json whole = summary();
  for (const auto& entry : whole["scenes"]) {
    if (entry["scene"] == scene) return entry;
  }
  ADD_FAILURE() << scene << " is not in the summary";
  return {};
}

std::vector<std::string> BatchFolder::outputs() const {
  std::vector<std::string> files = files_in(out());
  std::erase_if(files, [](const std::string& file) { return file.starts_with(".batch/") || file.starts_with("summary."); });
  return files;
}

std::map<std::string, std::string> pictures_in(const std::string& folder) {
  std::map<std::string, std::string> pictures;
  for (const std::string& file : files_in(folder)) {
    if (file.ends_with(".png") && !file.starts_with(".batch/")) pictures[file] = file_text(folder + "/" + file);
  }
  return pictures;
}

void expect_whole_files(const std::string& out, const std::string& reference) {
  for (const std::string& file : files_in(out)) {
    const std::string path = out + "/" + file;
    const std::string name = stdfs::path(file).filename().string();
    if (name.find(".tmp-") != std::string::npos || name == "lock") continue;
    if (file.ends_with(".json")) {
      EXPECT_TRUE(nlohmann::json::accept(file_text(path))) << file;
    } else if (file.ends_with(".html")) {
      EXPECT_TRUE(file_text(path).ends_with("</html>\n")) << file;
    } else if (file.ends_with(".png") && !file.starts_with(".batch/")) {
      EXPECT_TRUE(file_text(path) == file_text(reference + "/" + file)) << file;
    } else if (file.ends_with(".exr")) {
      const auto a = read_exr(posix_file_system(), path, 1 << 20);
      const auto b = read_exr(posix_file_system(), reference + "/" + file, 1 << 20);
      ASSERT_TRUE(a.ok() && b.ok()) << file;
      EXPECT_TRUE(diff_images(a.value(), b.value()).identical) << file;
    }
  }
}

void expect_no_temporaries(const std::string& folder) {
  for (const std::string& file : files_in(folder)) EXPECT_EQ(file.find(".tmp-"), std::string::npos) << file;
}

}  // namespace shoal::testing
