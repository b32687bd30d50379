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

step(":write")
vim.cmd("silent write")
note("  saved")
finish(0)
