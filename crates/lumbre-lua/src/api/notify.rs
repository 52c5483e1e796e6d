//! `x:notify`: a command that runs at the end of a night, at failures and at alarms.

use mlua::Value as LuaValue;

use super::{ApiFn, Args, functions};
use crate::error::ScriptError;
use crate::strict::Fields;
use lumbre_light::value::Value;
use lumbre_light::value::schema::{SchemaError, Ty, duration_s};
use lumbre_night::experiment::spec::{NOTICE_PLACEHOLDERS, Notice, NoticeEvent};
use lumbre_render::external::words;

/// Longest time that a command may take by default, in seconds.
const TIMEOUT_S: f64 = 30.0;

lumbre_light::table! {
    /// Options of `x:notify`.
    pub const NOTIFY = "Notify",
        "A command that is run at events of the night, beside it: the night waits for it only at \
         its end.";
    command: Ty::Str,
        "program and arguments, run without a shell; quotes enclose words with spaces; \
         placeholders: {event} is `end`, `failure` or `alarm`, {text} what happened, {name} the \
         experiment, {folder} the night's folder";
    on = "all of them": Ty::OneOrMany(&Ty::Word(NoticeEvent::NAMES)),
        "events that it is run for: the end of the night, a run that failed, or a bias check that \
         found a difference";
    timeout = "30s": Ty::Duration,
        "time after which the command is ended; a command that was ended is not run again in this \
         night";
}

functions! {
    /// Method that declares a notice.
    pub const METHODS;
    "x:notify" = notify,
        "Runs a command at the end of a night, when a run fails, and when a bias check finds a \
         difference. May be called several times. Commands run only with --allow-commands or after \
         the question in the terminal was answered, and `lumbre plan` shows them. A command that \
         fails is a warning." {
        "options": "Notify", "Command and events.";
    }
}

fn notify(args: &Args) -> Result<LuaValue, ScriptError> {
    let fields = args.fields(0, "options", &NOTIFY, "notify")?;
    let notice = notice(&fields).map_err(|e| args.locate_error(e))?;
    args.shared.builder.borrow_mut().night.notices.push(notice);
    Ok(LuaValue::Nil)
}

/// Converts checked options.
fn notice(fields: &Fields) -> Result<Notice, SchemaError> {
    let fail = |key: &str, problem: String| SchemaError::new(format!("notify.{key}"), key, problem);
    let line = fields.text("command");
    let command = words::split(line.unwrap_or_default())
        .and_then(|command| words::check(&command, &NOTICE_PLACEHOLDERS).map(|()| command))
        .map_err(|problem| fail("command", problem))?;
    let events = match fields.values.get("on") {
        None => NoticeEvent::ALL.to_vec(),
        Some(on) => {
            let named = on.as_list().unwrap_or(std::slice::from_ref(on));
            let named = named.iter().filter_map(Value::as_str);
            named.filter_map(NoticeEvent::from_name).collect()
        }
    };
    if events.is_empty() {
        return Err(fail("on", "names no event".to_owned()));
    }
    let timeout_s = fields.values.get("timeout").and_then(duration_s);
    let timeout_s = timeout_s.unwrap_or(TIMEOUT_S);
    if timeout_s <= 0.0 {
        return Err(fail("timeout", "expected a duration above 0".to_owned()));
    }
    Ok(Notice {
        command,
        events,
        timeout_s,
    })
}
