// The files that the JSON of a glTF names (buffers and images), found without making a document of it: text of any size
// goes through in pieces, and nothing but names is kept. Called by engine/scene_content. Thread rule: one owner.
// Cost: a few nanoseconds a byte.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace shoal {

/// On text that is not JSON it finds anything or nothing: what reads the scene refuses that.
class NamedFiles {
 public:
  void add(std::string_view text);
  /// URIs as they stand, in their order; no data: URIs.
  const std::vector<std::string>& uris() const { return uris_; }

 private:
  void begin(bool object);
  void end();
  void string_ended();
  void escaped(char c);

  static constexpr size_t kMaxUriBytes = 16u << 10;  ///< longer ones are data:, or no name that a file could have
  static constexpr uint32_t kFileDepth = 3;          ///< { "images": [ { "uri": ...
  std::vector<std::string> uris_;
  std::string string_, key_, section_;  ///< the string at hand; the last key of an object of files; the first of the root
  std::vector<bool> is_object_;         ///< of what is open, outermost first
  bool in_string_ = false, is_key_ = false, escape_ = false;
  uint32_t hex_left_ = 0, code_ = 0, high_surrogate_ = 0;
};

}  // namespace shoal
