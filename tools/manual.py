"""Manual pages and bash's completion from what a program says of itself.

manual.py PROGRAM VERSION FOLDER writes FOLDER/man1/PROGRAM.1.gz, PROGRAM-COMMAND.1.gz, FOLDER/completion/PROGRAM, and the
first page without compression, whose time is the build's."""
import gzip
import pathlib
import re
import subprocess
import sys
import textwrap

SECTIONS = ("Positionals", "Options", "Subcommands")


def read_help(command, *words):
    """(description, usage, {section: [(names, kind, text)]}, lines below)"""
    text = subprocess.run([command, *words, "--help"], check=True, capture_output=True, text=True).stdout
    above, _, rest = text.partition("\nUsage: ")
    usage, _, rest = rest.partition("\n")
    sections, below, section = {name: [] for name in SECTIONS}, [], None
    for line in rest.splitlines():
        if line.rstrip(":") in SECTIONS:
            section = line.rstrip(":")
        elif line.startswith("  ") and section:
            head, entry = re.match(r" {2}(\S.*?)(?: {2,}(.*))?$", line), sections[section]
            if line.startswith(" " * 20):
                entry[-1][2] = (entry[-1][2] + " " + line.strip()).strip()
            else:
                names, _, kind = head[1].partition(" ")
                entry.append([names, kind, head[2] or ""])
        elif line:
            section = None
            below.append(line)
    return above.strip(), usage, sections, below


def names_of(entry):
    return [name.partition("=")[0] for name in entry[0].split(",")]


def choices_of(entry):
    found = re.search(r"\{([^}]+)\}", entry[1])
    return found[1].split(",") if found else []


def roff(text):
    text = text.replace("\\", "\\e").replace("-", "\\-").replace("`", "\\(ga")
    return re.sub(r"^([.'])", r"\\&\1", text, flags=re.M)


def page(name, summary, usage, sections, below, version, body=(), see=()):
    out = [f'.TH {name.upper()} 1 "" "Lumicut {version}" "User Commands"', ".SH NAME", f"{name} \\- {roff(summary)}", ".SH SYNOPSIS",
           f".B {roff(usage)}"]
    if body:
        out += [".SH DESCRIPTION", ".nf", *map(roff, body), ".fi"]
    for section in SECTIONS:
        if not sections[section]:
            continue
        out.append(f".SH {'ARGUMENTS' if section == 'Positionals' else 'COMMANDS' if section == 'Subcommands' else 'OPTIONS'}")
        for names, kind, text in sections[section]:
            out += [".TP", f".B {roff(names.replace(',', ', ') + (' ' + kind if kind else ''))}"]
            out += [roff(line) for line in textwrap.wrap(text, 100)] or ["\\&"]
    if below:
        out.append(".SH NOTES")
        for line in below:
            out += [".PP", roff(line)]
    if see:
        out += [".SH SEE ALSO", ",\n".join(f".BR {roff(other)} (1)" for other in see).replace("),", ") ,")]
    return "\n".join(out) + "\n"


def summary_of(above):
    """The first line of a description, as the line NAME has it."""
    return above.splitlines()[0].removeprefix("Lumicut ").rstrip(".")


COMPLETION = """# bash completion of {program}(1), made of what the program says of itself.
{function}() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD-1]}} command=${{COMP_WORDS[1]-}}
  COMPREPLY=()
  if [ "$COMP_CWORD" -eq 1 ]; then
    mapfile -t COMPREPLY < <(compgen -W "{commands} --help" -- "$current")
    return
  fi
  case "$command $previous" in
{choices}  esac
  if [[ $current == -* ]]; then
    case $command in
{options}    esac
  else
    mapfile -t COMPREPLY < <(compgen -f -- "$current")
    compopt -o filenames 2>/dev/null
  fi
}}
complete -F {function} {program}
"""


def main():
    command, version, folder = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
    program = pathlib.Path(command).name
    for name in ("man1", "completion"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    above, usage, sections, below = read_help(command)
    commands = [entry[0] for entry in sections["Subcommands"]]
    pages = {program: page(program, summary_of(above), usage, sections, below, version, above.splitlines(),
                           [f"{program}-{c}" for c in commands])}
    options, choices = "", ""
    for name in commands:
        above, usage, sections, below = read_help(command, name)
        pages[f"{program}-{name}"] = page(f"{program}-{name}", summary_of(above), usage, sections, below, version, see=[program])
        words = [n for entry in sections["Options"] for n in names_of(entry)]
        options += f"      {name}) mapfile -t COMPREPLY < <(compgen -W '{' '.join(words)}' -- \"$current\") ;;\n"
        for entry in sections["Options"]:
            if choices_of(entry):
                patterns = "|".join(f"'{name} {n}'" for n in names_of(entry))
                choices += (f"    {patterns}) mapfile -t COMPREPLY < <(compgen -W '{' '.join(choices_of(entry))}' -- \"$current\")\n"
                            "      return ;;\n")
    for name, text in pages.items():
        with open(folder / "man1" / f"{name}.1.gz", "wb") as raw, gzip.GzipFile("", "wb", 9, raw, mtime=0) as out:
            out.write(text.encode())
    (folder / "completion" / program).write_text(COMPLETION.format(
        program=program, function="_" + program.replace("-", "_"), commands=" ".join(commands), options=options, choices=choices))
    (folder / f"{program}.1").write_text(pages[program])


if __name__ == "__main__":
    main()
