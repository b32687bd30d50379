-- A session of neovim with dodo lsp, step by step, as keys would call the same functions. What happens is written to
-- the file that DODO_TRANSCRIPT names.
local transcript = {}
local patience_ms = 60000

local function note(text)
  for line in vim.gsplit(text, "\n") do
    table.insert(transcript, (line:gsub("%s+$", "")))
  end
end

local function finish(status)
  vim.fn.writefile(transcript, vim.env.DODO_TRANSCRIPT)
  vim.cmd(status == 0 and "qall!" or "cquit " .. status)
end

local function await(what, condition)
  if not vim.wait(patience_ms, condition, 20) then
    note("there was no " .. what)
    finish(3)
  end
end

local function step(text)
  note("\n" .. text)
end

local function place(word)
  for number, line in ipairs(vim.api.nvim_buf_get_lines(0, 0, -1, false)) do
    local column = line:find(word, 1, true)
    if column then
      vim.api.nvim_win_set_cursor(0, { number, column - 1 })
      return
    end
  end
  note("there is no " .. word)
  finish(3)
end

local function line_of(number)
  return vim.api.nvim_buf_get_lines(0, number - 1, number, false)[1]
end

local function current()
  return vim.api.nvim_win_get_cursor(0)[1]
end

local function after_change(call)
  local before = vim.api.nvim_buf_get_changedtick(0)
  call()
  await("change", function() return vim.api.nvim_buf_get_changedtick(0) ~= before end)
end

local function problems(number)
  await("diagnostics", function() return #vim.diagnostic.get(0) == number end)
  local found = vim.diagnostic.get(0)
  table.sort(found, function(a, b) return a.lnum < b.lnum end)
  for _, one in ipairs(found) do
    local rule = one.code or one.user_data.lsp.code
    note(("  %d:%d %s (%s)"):format(one.lnum + 1, one.col + 1, one.message:gsub("\n", "; "), rule))
  end
  if number == 0 then
    note("  no problems")
  end
end

vim.ui.select = function(items, options, choose)
  for _, item in ipairs(items) do
    note("  offered: " .. (options.format_item or tostring)(item))
  end
  choose(items[1], 1)
end

step(":edit " .. vim.fn.fnamemodify(vim.api.nvim_buf_get_name(0), ":."))
problems(2)

for _, word in ipairs({ "freqq", "integrater" }) do
  step("vim.lsp.buf.code_action() on " .. word)
  place(word)
  after_change(function() vim.lsp.buf.code_action() end)
  note(("  line %d is now: %s"):format(current(), vim.trim(line_of(current()))))
end
problems(0)

step("vim.lsp.buf.hover() on freq")
place("freq")
vim.lsp.buf.hover()
local shown
await("hover", function()
  for _, window in ipairs(vim.api.nvim_list_wins()) do
    if vim.api.nvim_win_get_config(window).relative ~= "" then
      shown = window
    end
  end
  return shown
end)
for _, line in ipairs(vim.api.nvim_buf_get_lines(vim.api.nvim_win_get_buf(shown), 0, -1, false)) do
  note("  " .. line)
end
vim.api.nvim_win_close(shown, true)

step("completion behind fr, in a new line below yaw")
place("yaw")
vim.api.nvim_buf_set_lines(0, current(), current(), false, { "      fr" })
vim.api.nvim_win_set_cursor(0, { current() + 1, 7 })
local asked = vim.lsp.util.make_position_params()
asked.position.character = 8
local answers = vim.lsp.buf_request_sync(0, "textDocument/completion", asked, patience_ms)
for _, answer in pairs(answers or {}) do
  for _, item in ipairs(vim.lsp.util.extract_completion_items(answer.result)) do
    if vim.startswith(item.label, "fr") then
      note("  " .. item.label .. (item.detail and ": " .. item.detail or ""))
    end
  end
end
vim.api.nvim_buf_set_lines(0, current() - 1, current(), false, { "      freq: 50 Hz" })
problems(0)

step("vim.lsp.buf.definition() on ../maps/straight")
local before = vim.api.nvim_get_current_buf()
place("../maps/straight")
vim.lsp.buf.definition()
await("definition", function() return vim.api.nvim_get_current_buf() ~= before end)
note(("  %s, line %d"):format(vim.fn.fnamemodify(vim.api.nvim_buf_get_name(0), ":."), current()))
vim.api.nvim_set_current_buf(before)

step("vim.lsp.buf.rename('eye') on camera")
place("camera:")
after_change(function() vim.lsp.buf.rename("eye") end)
note(("  line %d is now: %s"):format(current(), vim.trim(line_of(current()))))
problems(0)

step(":write")
vim.cmd("silent write")
note("  saved")
finish(0)
