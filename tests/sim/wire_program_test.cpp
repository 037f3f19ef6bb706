// plumbline-simrig as a process: started, found by its ready file, used, ended.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>

#include <csignal>
#include <fstream>
#include <sstream>

#include "tests/sim/wire_rig.h"

extern char** environ;

namespace plumbline::sim {
namespace {

using ::testing::HasSubstr;

const std::string kProgram = PLUMBLINE_BINARY_DIR "/plumbline-simrig";

std::string text_of(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

class WireProgram : public ::testing::Test {
 protected:
  pid_t start(std::vector<std::string> arguments) {
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    const int flags = O_WRONLY | O_CREAT | O_TRUNC;
    posix_spawn_file_actions_addopen(&files, 1, directory.file("out").c_str(), flags, 0600);
    posix_spawn_file_actions_addopen(&files, 2, directory.file("err").c_str(), flags, 0600);
    pid_t pid = -1;
    EXPECT_EQ(::posix_spawn(&pid, argv[0], &files, nullptr, argv.data(), environ), 0);
    posix_spawn_file_actions_destroy(&files);
    return pid;
  }
  static int wait_for(pid_t pid) {
    int status = 0;
    ::waitpid(pid, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }
  int run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), kProgram);
    return wait_for(start(std::move(arguments)));
  }
  std::string world(const std::string& text) {
    std::ofstream(directory.file("world.toml")) << text;
    return directory.file("world.toml");
  }
  std::vector<std::string> serving(const std::string& modbus) {
    return {kProgram, "--world",      world("# the default world\n"),  "--modbus",
            modbus,   "--can",        "unix:" + directory.file("can"), "--speed",
            "50",     "--ready-file", directory.file("ready.toml")};
  }
  std::string endpoint(const std::string& key) {
    auto file = rig::StrictFile::read(directory.file("ready.toml"));
    EXPECT_TRUE(file.has_value());
    return file ? file->root().text(key) : "";
  }
  bool is_ready() {
    return eventually([&] { return std::filesystem::exists(directory.file("ready.toml")); }, 60);
  }

  TempFolder directory;
};

TEST_F(WireProgram, ServesBothWiresAndEndsCleanly) {
  for (const std::string& modbus :
       {std::string("tcp:127.0.0.1:0"), "rtu:" + directory.file("tty")}) {
    const pid_t pid = start(serving(modbus));
    ASSERT_TRUE(is_ready()) << text_of(directory.file("err"));
    EXPECT_THAT(text_of(directory.file("ready.toml")),
                HasSubstr("modbus = \"" + modbus.substr(0, 4)));
    {
      ModbusClient head(endpoint("modbus"));
      FrameClient node(endpoint("can"));
      head.pulse(0x000, 1u << 4);
      EXPECT_TRUE(eventually([&] { return head.bit(0x000, 4); }));
      can_frame frame{};
      EXPECT_TRUE(node.next(frame));
    }
    ::kill(pid, SIGTERM);
    EXPECT_EQ(wait_for(pid), 0);
    EXPECT_FALSE(std::filesystem::exists(directory.file("can")));
    EXPECT_FALSE(std::filesystem::exists(directory.file("ready.toml")));
    EXPECT_FALSE(std::filesystem::is_symlink(directory.file("tty")));
  }
}

TEST_F(WireProgram, EndsWithTheProgramThatStartedIt) {
  std::vector<std::string> arguments = serving("tcp:127.0.0.1:0");
  arguments.emplace_back("--exit-with-parent");
  std::string line;
  for (const std::string& argument : arguments) line += "'" + argument + "' ";
  const pid_t shell = start({"/bin/sh", "-c", line + "& wait"});
  ASSERT_TRUE(is_ready()) << text_of(directory.file("err"));
  ::kill(shell, SIGKILL);
  EXPECT_EQ(wait_for(shell), -SIGKILL);
  EXPECT_TRUE(eventually([&] { return !std::filesystem::exists(directory.file("can")); }));
}

TEST_F(WireProgram, WrongUseIsExitCodeTwoAndOneLine) {
  const std::string good = world("");
  const std::string can = "unix:" + directory.file("can");
  const std::vector<std::vector<std::string>> wrong = {
      {},
      {"--frobnicate"},
      {"--world", directory.file("none.toml"), "--modbus", "tcp:127.0.0.1:0", "--can", can},
      {"--world", good, "--modbus", "tcp:127.0.0.1:0", "--can", "carrier-pigeon"},
      {"--world", good, "--modbus", "telegraph", "--can", can},
      {"--world", good, "--modbus", "tcp:127.0.0.1:0", "--can", can, "--speed", "0"},
      {"--world", good, "--modbus", "tcp:127.0.0.1:0", "--can", can, "--ready-file",
       directory.file("no/such/folder")},
  };
  for (const auto& arguments : wrong) {
    EXPECT_EQ(run(arguments), 2) << ::testing::PrintToString(arguments);
    const std::string message = text_of(directory.file("err"));
    EXPECT_EQ(std::count(message.begin(), message.end(), '\n'), 1) << message;
    EXPECT_FALSE(std::filesystem::exists(directory.file("can")));
  }
  world("[drive]\nunit_idd = 2\n");
  EXPECT_EQ(run({"--world", good, "--modbus", "tcp:127.0.0.1:0", "--can", can}), 2);
  EXPECT_THAT(text_of(directory.file("err")), HasSubstr("unit_id"));
}

TEST_F(WireProgram, WhatCannotBeServedIsExitCodeThree) {
  EXPECT_EQ(run({"--world", world(""), "--modbus", "tcp:127.0.0.1:0", "--can", "can:nosuchcan0"}),
            3);
  EXPECT_THAT(text_of(directory.file("err")), HasSubstr("can:nosuchcan0"));
}

TEST_F(WireProgram, HelpAndVersion) {
  EXPECT_EQ(run({"--help"}), 0);
  EXPECT_THAT(text_of(directory.file("out")), HasSubstr("--ready-file"));
  EXPECT_EQ(run({"--version"}), 0);
  EXPECT_THAT(text_of(directory.file("out")), HasSubstr("plumbline-simrig "));
}

}  // namespace
}  // namespace plumbline::sim
