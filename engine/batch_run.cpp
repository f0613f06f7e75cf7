#include "engine/batch_run.h"

#include <fmt/format.h>
#include <signal.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <deque>
#include <filesystem>
#include <thread>

#include "engine/batch_asked.h"
#include "engine/batch_sweep.h"
#include "engine/batch_text.h"
#include "engine/build_record.h"
#include "engine/process_memory.h"
#include "engine/render_report.h"
#include "io/child_process.h"
#include "io/content_hash.h"
#include "io/file_lock.h"
#include "io/image.h"
#include "io/png_thumbnail.h"

namespace shoal {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kMemoryCapExit = static_cast<int>(ErrorCode::kMemoryCap);
constexpr int kInputExit = static_cast<int>(ErrorCode::kInput), kCorruptExit = static_cast<int>(ErrorCode::kCorrupt);
constexpr int kStoppedExit = static_cast<int>(ErrorCode::kStopped);
constexpr uint32_t kThumbnailSide = 160;
/// Of this process beside what it holds when it begins: a block to hash, records and statistics being read, a row of a
/// picture.
constexpr uint64_t kOwnGrowthBytes = 8u << 20;
constexpr auto kLongestWait = std::chrono::milliseconds(200);
/// Renders of a batch that was killed hear of it at once and then end as by SIGTERM.
constexpr auto kOrphanPatience = std::chrono::seconds(60);

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

std::vector<std::string> outputs_of(const BatchPaths& paths, const BatchScene& scene) {
  return {paths.picture(scene), paths.png(scene), paths.stats(scene)};
}

/// Sizes of the outputs; a missing one has none.
std::vector<uint64_t> output_sizes(const BatchPaths& paths, const BatchScene& scene) {
  std::vector<uint64_t> sizes;
  for (const std::string& path : outputs_of(paths, scene)) {
    std::error_code error;
    const uint64_t bytes = std::filesystem::is_regular_file(path, error) ? std::filesystem::file_size(path, error) : 0;
    sizes.push_back(error ? 0 : bytes);
  }
  return sizes;
}

uint64_t key_of(const SceneContent& content, const std::vector<std::string>& options) {
  ContentHash hash;
  hash.add_text("batch 1 " SHOAL_VERSION);
  hash.add_text(kBuilderVersion);
  hash.add_number(kSceneVersion);
  hash.add_number(content.hash);
  for (const std::string& word : options) hash.add_text(word);
  return std::max<uint64_t>(hash.value(), 1);  // 0: it changed meanwhile
}

/// The last thing that a render said: its error, or else its last line.
std::string last_message(FileSystem& fs, const std::string& log) {
  constexpr uint64_t kTailBytes = 16u << 10;
  const auto file = fs.open(log, ReadMode::kBuffered);
  if (!file.ok()) return "";
  const uint64_t bytes = std::min(file.value()->size_bytes(), kTailBytes);
  std::string tail(bytes, '\0');
  const uint64_t offset = file.value()->size_bytes() - bytes;
  if (!file.value()->read_at(offset, std::as_writable_bytes(std::span(tail))).ok()) return "";
  std::string last, said;
  for (size_t begin = 0; begin < tail.size();) {
    const size_t end = std::min(tail.find('\n', begin), tail.size());
    const std::string line = tail.substr(begin, end - begin);
    if (!line.empty()) last = line;
    if (line.starts_with("shoal: ")) said = line.substr(7);
    begin = end + 1;
  }
  return said.empty() ? last : said;
}

/// What is still true of a scene that is rendered again.
SceneRecord forgotten(SceneRecord before) {
  SceneRecord now;
  now.scene = std::move(before.scene);
  now.output = std::move(before.output);
  now.key = before.key;
  now.options = std::move(before.options);
  now.content = std::move(before.content);
  return now;
}

bool is_file(const std::string& path) {
  std::error_code error;
  return std::filesystem::is_regular_file(path, error);
}

struct RunningRender {
  size_t entry = 0;
  ChildProcess process;
  BatchShare taken;  ///< of the budget
  bool resumed = false;  ///< there was a checkpoint to go on from
  Clock::time_point start;
};

class BatchRun {
 public:
  BatchRun(FileSystem& fs, const BatchOptions& options, const RenderOptionRules& rules, const BatchHooks& hooks,
           const BatchPlan& plan, const BatchShare& budget)
      : fs_(fs), options_(options), rules_(rules), hooks_(hooks), paths_(options.out), budget_(budget), left_(budget) {
    standing_.options = &options_;
    standing_.unreadable = plan.unreadable;
    standing_.max_memory_bytes = options.max_memory_bytes > 0 ? options.max_memory_bytes : default_cap_bytes();
    standing_.threads = budget.threads;
    for (const BatchScene& scene : plan.scenes) standing_.entries.push_back({scene, {}, false});
    jobs_ = static_cast<unsigned>(std::clamp<size_t>(options.jobs, 1, plan.scenes.size()));
  }

  Result<BatchResult> run() {
    SHOAL_RETURN_IF_ERROR(fs_.create_folder(paths_.state));
    SHOAL_ASSIGN_OR_RETURN(FileLock lock, FileLock::acquire(paths_.lock(), kOrphanPatience, hooks_.stop));
    lock_ = lock.descriptor();
    sweep();
    for (const char* name : {"records", "logs", "thumbnails", "built"}) {
      SHOAL_RETURN_IF_ERROR(fs_.create_folder(paths_.state + "/" + name));
    }
    SHOAL_RETURN_IF_ERROR(write_asked(fs_, options_));
    const ChildWatch watch;
    while (true) {
      if (stopped() && !told_) tell_all();
      SHOAL_RETURN_IF_ERROR(reap());
      SHOAL_RETURN_IF_ERROR(start_what_fits());
      if (running_.empty() && (stopped() || nothing_waits())) break;
      if (hooks_.progress) hooks_.progress(standing_.counts(), seconds_since(start_));
      watch.wait(kLongestWait);
    }
    const BatchCounts counts = standing_.counts();
    standing_.state = counts.left > 0 ? "stopped" : "finished";
    SHOAL_RETURN_IF_ERROR(summarize());
    return BatchResult{counts, counts.left > 0, !standing_.unreadable.empty()};
  }

 private:
  bool stopped() const { return hooks_.stop != nullptr && hooks_.stop->load(); }
  bool nothing_waits() const { return next_ == standing_.entries.size() && alone_.empty(); }
  void warn(const std::string& message) const {
    if (hooks_.warning) hooks_.warning(message);
  }

  /// What a batch that was killed, and its renders, left.
  void sweep() {
    std::vector<std::string> files = {paths_.summary(), paths_.page(), paths_.asked()};
    for (const BatchEntry& entry : standing_.entries) {
      for (std::string& path : outputs_of(paths_, entry.scene)) files.push_back(std::move(path));
      files.push_back(paths_.checkpoint(entry.scene));
      files.push_back(paths_.record(entry.scene));
      files.push_back(paths_.thumbnail(entry.scene));
    }
    remove_temporaries(files);
    remove_all_temporaries(paths_.state + "/built");
    if (!options_.keep_built) remove_folder(paths_.state + "/built");
  }

  void remove_checkpoint(const BatchScene& scene) const {
    std::error_code ignored;
    std::filesystem::remove(paths_.checkpoint(scene), ignored);
  }

  void tell_all() {
    told_ = true;
    for (const RunningRender& render : running_) render.process.tell(SIGTERM);
  }

  Status reap() {
    for (size_t i = 0; i < running_.size();) {
      const auto end = running_[i].process.ended();
      if (!end) {
        ++i;
        continue;
      }
      RunningRender render = std::move(running_[i]);
      running_.erase(running_.begin() + static_cast<ptrdiff_t>(i));
      left_.memory_bytes += render.taken.memory_bytes;
      left_.threads += render.taken.threads;
      SHOAL_RETURN_IF_ERROR(render_ended(render, *end));
    }
    return {};
  }

  Status start_what_fits() {
    while (!stopped() && running_.size() < jobs_ && next_ < standing_.entries.size()) {
      const size_t left = standing_.entries.size() - next_;
      const auto starting = static_cast<unsigned>(std::min<size_t>(jobs_ - running_.size(), left));
      SHOAL_RETURN_IF_ERROR(begin(next_++, next_share(left_, starting)));
    }
    if (!stopped() && running_.empty() && next_ == standing_.entries.size() && !alone_.empty()) {
      const size_t entry = alone_.front();
      alone_.pop_front();
      standing_.entries[entry].record.alone = true;
      SHOAL_RETURN_IF_ERROR(start(entry, budget_));
    }
    return {};
  }

  /// Looks whether the scene is done, and starts its render if it is not.
  Status begin(size_t index, const BatchShare& share) {
    BatchEntry& entry = standing_.entries[index];
    if (entry.scene.error) return set_aside(entry, *entry.scene.error);
    auto look = look_at_scene(fs_, options_, rules_, entry.scene, hooks_.stop);
    if (!look.ok() && look.error().code == ErrorCode::kStopped) {
      --next_;
      return {};
    }
    if (!look.ok()) return set_aside(entry, look.error());
    entry.record = std::move(look.value().record);
    entry.skipped = look.value().done && !options_.force;
    if (look.value().done && options_.force) entry.record = forgotten(std::move(entry.record));
    if (entry.skipped) {
      // What was read to know its hash need not be read again, now that its time is known as well.
      if (entry.record.content.anew) SHOAL_RETURN_IF_ERROR(write_record(fs_, paths_.record(entry.scene), entry.record));
      return ended(entry);
    }
    if (look.value().content_changed) remove_folder(paths_.built(entry.scene));
    if (!look.value().as_before || options_.force) remove_checkpoint(entry.scene);
    return start(index, share);
  }

  Status start(size_t index, const BatchShare& share) {
    BatchEntry& entry = standing_.entries[index];
    SceneRecord& record = entry.record;
    record.state = SceneState::kStarted;
    record.message.clear();
    record.max_memory_bytes = share.memory_bytes;
    record.threads = share.threads;
    // Before the render: from here on its outputs may be replaced, and an older record must not vouch for them.
    SHOAL_RETURN_IF_ERROR(write_record(fs_, paths_.record(entry.scene), record));
    if (const Status made = fs_.create_folder(paths_.folder(entry.scene)); !made.ok()) return failed(entry, made.error());
    const bool resumed = is_file(paths_.checkpoint(entry.scene));
    const ChildCommand command{render_command(options_, rules_, entry.scene, share), paths_.log(entry.scene), lock_};
    auto process = ChildProcess::start(command);
    if (!process.ok()) return failed(entry, process.error());
    const BatchShare taken{share.memory_bytes, std::min(left_.threads, share.threads)};
    left_.memory_bytes -= taken.memory_bytes;
    left_.threads -= taken.threads;
    running_.push_back({index, std::move(process).value(), taken, resumed, Clock::now()});
    if (hooks_.started) hooks_.started(entry);
    return {};
  }

  Status render_ended(const RunningRender& render, const ChildEnd& end) {
    BatchEntry& entry = standing_.entries[render.entry];
    SceneRecord& record = entry.record;
    record.seconds += seconds_since(render.start);
    record.processor_seconds += end.user_seconds + end.system_seconds;
    record.process_peak_rss_bytes = std::max(record.process_peak_rss_bytes, end.peak_rss_bytes);
    record.process_disk_read_bytes += end.disk_read_bytes;
    record.process_disk_written_bytes += end.disk_written_bytes;
    record.exit_code = end.signal != 0 ? 128 + end.signal : end.exit_code;
    if (record.exit_code != 0) {
      remove_temporaries(outputs_of(paths_, entry.scene));
      remove_temporaries({paths_.checkpoint(entry.scene)});
      remove_all_temporaries(paths_.built(entry.scene));
    }
    if (!options_.keep_built) remove_folder(paths_.built(entry.scene));
    const bool stopped_by_us =
        (told_ || stopped()) && (end.exit_code == kStoppedExit || end.signal == SIGTERM || end.signal == SIGINT);
    if (stopped_by_us) {
      record.message.clear();
      return {};  // its record says "started": it is rendered by the next batch
    }
    const bool share_too_small = record.exit_code == kMemoryCapExit && render.taken.memory_bytes < budget_.memory_bytes;
    if (share_too_small) {
      alone_.push_back(render.entry);
      return {};
    }
    // A checkpoint that is damaged, or of a scene that was built with another share of memory: without it. What else is
    // damaged or missing is no fault of the checkpoint's.
    const bool refused = render.resumed && (record.exit_code == kInputExit || record.exit_code == kCorruptExit) &&
                         record.message.find(".checkpoint") != std::string::npos;
    if (refused && !told_) {
      remove_checkpoint(entry.scene);
      return start(render.entry, render.taken);
    }
    return record.exit_code == 0 ? finished(entry) : failed_render(entry, end);
  }

  Status finished(BatchEntry& entry) {
    SceneRecord& record = entry.record;
    record.state = SceneState::kDone;
    record.output_bytes = output_sizes(paths_, entry.scene);
    auto figures = read_figures(fs_, paths_.stats(entry.scene));
    if (!figures.ok()) return failed(entry, figures.error());
    record.figures = std::move(figures).value();
    if (!looks_unchanged(fs_, record.content)) {
      record.key = 0;
      warn(fmt::format("{} changed while it was rendered: the next batch renders it again", escape_name(record.scene)));
    }
    const auto small = shrink_png(fs_, paths_.png(entry.scene), kThumbnailSide);
    const Status drawn = small.ok() ? write_png(fs_, paths_.thumbnail(entry.scene), small.value().width,
                                                small.value().height, small.value().rgb)
                                    : Status(small.error());
    if (!drawn.ok()) warn(drawn.error().message);
    return ended(entry);
  }

  Status failed_render(BatchEntry& entry, const ChildEnd& end) {
    std::string message = last_message(fs_, paths_.log(entry.scene));
    if (end.signal != 0) {
      message = fmt::format("ended by signal {} ({}){}{}", end.signal, ::strsignal(end.signal),
                            message.empty() ? "" : "; it said last: ", message);
    }
    entry.record.message = std::move(message);
    entry.record.state = SceneState::kFailed;
    return ended(entry);
  }

  static void note_failure(BatchEntry& entry, const Error& error) {
    entry.record.exit_code = static_cast<int>(error.code);
    entry.record.message = error.message;
    entry.record.state = SceneState::kFailed;
  }

  Status failed(BatchEntry& entry, const Error& error) {
    note_failure(entry, error);
    return ended(entry);
  }

  /// A scene that cannot be looked at. What stands on disk of it, pictures and record, stays: it may be as it was next time.
  Status set_aside(BatchEntry& entry, const Error& error) {
    note_failure(entry, error);
    return announce(entry);
  }

  Status ended(BatchEntry& entry) {
    if (!entry.skipped) {
      entry.record.ended_unix_seconds =
          std::chrono::duration_cast<std::chrono::seconds>(std::chrono::system_clock::now().time_since_epoch()).count();
      SHOAL_RETURN_IF_ERROR(write_record(fs_, paths_.record(entry.scene), entry.record));
    }
    entry.record.content = {};  // of very many scenes too much to keep
    return announce(entry);
  }

  Status announce(BatchEntry& entry) {
    if (hooks_.ended) hooks_.ended(entry, standing_.counts());
    // After each scene, but not for a tenth of the time or more: those of very many scenes are large.
    if (seconds_since(summary_ended_) < 10 * summary_seconds_) return {};
    return summarize();
  }

  Status summarize() {
    const Clock::time_point begin = Clock::now();
    standing_.seconds = seconds_since(start_);
    const Status written = write_summary(fs_, standing_);
    summary_ended_ = Clock::now();
    summary_seconds_ = std::chrono::duration<double>(summary_ended_ - begin).count();
    return written;
  }

  FileSystem& fs_;
  const BatchOptions& options_;
  const RenderOptionRules& rules_;
  const BatchHooks& hooks_;
  const BatchPaths paths_;
  const BatchShare budget_;
  BatchShare left_;
  BatchStanding standing_;
  unsigned jobs_ = 1;
  int lock_ = -1;
  size_t next_ = 0;            ///< of the entries: not looked at yet
  std::deque<size_t> alone_;   ///< whose share did not suffice
  std::vector<RunningRender> running_;
  bool told_ = false;          ///< the renders have been told to end
  Clock::time_point start_ = Clock::now(), summary_ended_ = {};
  double summary_seconds_ = 0;
};

}  // namespace

Result<BatchShare> batch_budget(const BatchOptions& options) {
  const uint64_t all = options.max_memory_bytes > 0 ? options.max_memory_bytes : default_cap_bytes();
  const uint64_t own = resident_set_bytes() + kOwnGrowthBytes;
  if (all <= own) {
    return Error{ErrorCode::kMemoryCap, fmt::format("a memory cap of {} cannot work: the batch itself takes {}",
                                                    format_bytes(all), format_bytes(own))};
  }
  const unsigned machine = std::max(std::thread::hardware_concurrency(), 1u);
  return BatchShare{all - own, options.threads > 0 ? options.threads : machine};
}

Result<SceneLook> look_at_scene(FileSystem& fs, const BatchOptions& options, const RenderOptionRules& rules,
                                const BatchScene& scene, const std::atomic<bool>* stop) {
  const BatchPaths paths(options.out);
  const auto before = read_record(fs, paths.record(scene));
  std::vector<std::string> option_files;
  if (std::string file = environment_file(scene.options); !file.empty()) option_files.push_back(std::move(file));
  SceneLook look;
  SceneRecord& record = look.record;
  record.scene = scene.scene;
  record.output = scene.output;
  SHOAL_ASSIGN_OR_RETURN(record.content, hash_scene(fs, options.folder + "/" + scene.scene, option_files,
                                                    before ? &before->content : nullptr, stop));
  record.options = option_words(scene.options, rules);
  record.key = key_of(record.content, record.options);
  if (!before) return look;
  look.as_before = before->key == record.key && before->scene == scene.scene;
  look.content_changed = before->content.hash != record.content.hash;
  look.done = before->state == SceneState::kDone && look.as_before &&
              before->output_bytes == output_sizes(paths, scene);
  if (!look.done) return look;
  SceneContent now = std::move(record.content);
  record = *before;
  record.content = std::move(now);
  return look;
}

Result<BatchResult> run_batch(FileSystem& fs, const BatchOptions& options, const RenderOptionRules& rules,
                              const BatchPlan& plan, const BatchHooks& hooks) {
  SHOAL_ASSIGN_OR_RETURN(const BatchShare budget, batch_budget(options));
  return BatchRun(fs, options, rules, hooks, plan, budget).run();
}

}  // namespace shoal
