// shoal(1). Options and commands are the program's own; the rest is written here.
#include <fmt/format.h>

#include "bins/command_reference.h"

namespace shoal {
namespace {

/// Plain text as roff: no escape, request or hyphen of its own.
std::string escape(const std::string& text) {
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    const bool line_begins = i == 0 || text[i - 1] == '\n';
    if (line_begins && (text[i] == '.' || text[i] == '\'')) out += "\\&";
    switch (text[i]) {
      case '\\':
        out += "\\e";
        break;
      case '-':
        out += "\\-";
        break;
      case '~':
        out += "\\(ti";
        break;
      case '^':
        out += "\\(ha";
        break;
      case '`':
        out += "\\(ga";
        break;
      default:
        out += text[i];
    }
  }
  return out;
}

std::string bold(const std::string& text) { return "\\fB" + escape(text) + "\\fR"; }
std::string italic(const std::string& text) { return "\\fI" + escape(text) + "\\fR"; }

/// **bold**, *italic* and `code` stay plain text: the written part uses roff itself where it wants them.
constexpr const char* kDescription = R"(.SH DESCRIPTION
Shoal is a path tracer for glTF scenes that do not fit in memory. It cuts a scene into treelets in a paged file, lets rays
wait for the treelet they need, and loads each one for the many rays that wait for it. A cap on memory holds for the whole
process, and the picture has the same bits whatever the cap, the order of rays or the number of threads.
.PP
.B shoal build
makes the paged file;
.B shoal render
makes a picture of it, or of a glTF, which it builds first.
Sizes are numbers of bytes with K, M, G or T behind them where wanted: 2G is 2147483648.
)";

constexpr const char* kEnding = R"(.SH ENVIRONMENT
.TP
.BR XDG_CACHE_HOME ", " HOME
Where scenes are kept that
.B render
builds:
.IR $XDG_CACHE_HOME/shoal ,
else
.IR $HOME/.cache/shoal .
.SH SIGNALS
SIGINT and SIGTERM end what runs in good order: files appear whole under their names or not at all.
.SH EXAMPLES
.nf
shoal generate terrain \-\-triangles 40M \-\-out terrain
shoal build terrain/terrain.gltf \-o scene.shoal
shoal render scene.shoal \-o picture.exr \-\-png picture.png \-\-spp 64 \-\-max\-memory 2G
shoal compare scene.shoal \-\-spp 1 \-\-max\-memory 2G \-\-out compared
shoal batch scenes \-\-out pictures \-\-spp 64 \-\-max\-memory 8G
.fi
)";

std::string option_line(const OptionReference& option) {
  std::string line;
  for (const std::string& name : option.names) line += (line.empty() ? "" : ", ") + bold(name);
  if (option.positional) line = italic(option.names.front());
  if (!option.value.empty() && !option.positional) line += " " + italic(option.value);
  return line;
}

std::string option_entry(const OptionReference& option) {
  std::string text = ".TP\n" + option_line(option) + "\n" + escape(option.description);
  if (!option.preset.empty()) text += escape(fmt::format(" [{}]", option.preset));
  if (option.required) text += " (required)";
  return text + "\n";
}

std::string usage(const CommandReference& command) {
  std::string line = bold("shoal " + command.name);
  for (const OptionReference& option : command.options) {
    if (option.positional) {
      const std::string name = italic(option.names.front());
      line += " " + (option.required ? name : "[" + name + "]");
    } else if (option.required) {
      line += " " + bold(option.names.back()) + " " + italic(option.value);
    }
  }
  return line + " [" + italic("options") + "]";
}

std::string command_section(const CommandReference& command) {
  std::string text = ".SS " + bold("shoal " + command.name) + "\n" + usage(command) + "\n.PP\n" +
                     escape(command.description) + ".\n";
  std::string group = "Options";
  for (const OptionReference& option : command.options) {
    if (!option.positional && option.group != group) {
      group = option.group;
      text += ".PP\n" + escape(group) + ":\n";
    }
    text += option_entry(option);
  }
  if (!command.footer.empty()) text += ".PP\n" + escape(command.footer) + "\n";
  return text;
}

}  // namespace

std::string man_page(const ProgramReference& program) {
  std::string text = fmt::format(
      ".\\\" Written by the program itself: shoal help --man\n"
      ".TH SHOAL 1 \"\" \"Shoal {}\" \"User Commands\"\n.nh\n.ad l\n"
      ".SH NAME\nshoal \\- render glTF scenes bigger than memory\n.SH SYNOPSIS\n",
      SHOAL_VERSION);
  for (const CommandReference& command : program.commands) text += usage(command) + "\n.br\n";
  text +=
      bold("shoal --version") + "\n.br\n" + bold("shoal") + " " + italic("command") + " " + bold("--help") + "\n";
  text += kDescription;
  text += ".SH COMMANDS\n";
  for (const CommandReference& command : program.commands) text += command_section(command);
  text += kEnding;
  return text + ".SH EXIT STATUS\n" + escape(program.footer) + "\n";
}

}  // namespace shoal
