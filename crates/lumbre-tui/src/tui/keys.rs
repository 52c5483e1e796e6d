//! Keys that change the screen, and the actions of the command bar.

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::layout::Rect;

use super::command::{self, Action};
use super::confirmation::{Confirmation, question};
use super::model::night::NightModel;
use super::modes::{ChartX, Focus, NightRequest, PictureMode, PlanLayout};
use super::panes;
use super::view::{NOTICE_S, Notice, Prompt, View};
use lumbre_night::experiment::CellRef;

/// Largest change of exposure in stops, up or down.
const MAX_STOPS: f32 = 12.0;

/// Number of frames that a jump through time skips.
const FRAME_JUMP: isize = 10;

impl View {
    /// Handles a key on a screen of size `area`; returns the request to the night, if any.
    pub fn key(&mut self, key: KeyEvent, model: &NightModel, area: Rect) -> Option<NightRequest> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        if key.modifiers.contains(KeyModifiers::CONTROL) {
            return (key.code == KeyCode::Char('c')).then_some(NightRequest::Stop);
        }
        if key.modifiers.contains(KeyModifiers::ALT) {
            // A terminal sends the same bytes for Alt and a letter as for Escape followed by the
            // letter. No key here uses Alt.
            self.key(KeyEvent::new(KeyCode::Esc, KeyModifiers::NONE), model, area);
        }
        if let Some(prompt) = self.prompt.take() {
            let order = self.edit_prompt(prompt, key.code, model)?;
            return self.execute(order, model, area);
        }
        let order = match key.code {
            KeyCode::Char('q') => Action::Night(NightRequest::Stop),
            KeyCode::Char('Q') => Action::Night(NightRequest::StopAfterCell),
            KeyCode::Char('p' | ' ') => Action::Night(NightRequest::Pause(None)),
            KeyCode::Char('s') => Action::Night(NightRequest::Skip),
            KeyCode::Char('R') => Action::Night(NightRequest::Restart),
            KeyCode::Char('f') => Action::Flicker,
            KeyCode::Char('v') => Action::Picture(self.picture_after(1)),
            KeyCode::Char('V') => Action::Picture(self.picture_after(PictureMode::ALL.len() - 1)),
            KeyCode::Char('e') => Action::Exposure(self.exposure - 0.5),
            KeyCode::Char('E') => Action::Exposure(self.exposure + 0.5),
            KeyCode::Char('0') => Action::Exposure(0.0),
            KeyCode::Char(digit @ '1'..='9') => Action::Metric(digit as usize - '1' as usize),
            KeyCode::Char('?') | KeyCode::F(1) => Action::Help,
            other => {
                self.screen_key(other, model, area);
                return None;
            }
        };
        self.execute(order, model, area)
    }

    /// Handles keys that change the screen and have no command in the command bar.
    fn screen_key(&mut self, code: KeyCode, model: &NightModel, area: Rect) {
        match code {
            KeyCode::Char(':') => self.prompt = Some(Prompt::Command(String::new())),
            KeyCode::Char('/') => self.prompt = Some(Prompt::Filter(self.filter.clone())),
            KeyCode::Esc if self.help => self.help = false,
            KeyCode::Esc => {
                (self.focus, self.plan_top, self.log_back) = (Focus::Overview, None, 0);
                self.stop_animation(model);
                (self.flicker, self.notice) = (false, None);
                self.filter.clear();
            }
            KeyCode::Tab => self.focus = self.focus.next(),
            KeyCode::BackTab => self.focus = self.focus.moved(4),
            KeyCode::Char('x') => {
                self.chart_x = match self.chart_x {
                    ChartX::RenderS => ChartX::Samples,
                    ChartX::Samples => ChartX::RenderS,
                };
            }
            KeyCode::Char('w') => self.unweighted = !self.unweighted,
            KeyCode::Char('t') => self.toggle_animation(model),
            KeyCode::Left => self.step_frames(-1, model),
            KeyCode::Right => self.step_frames(1, model),
            KeyCode::Char('<') => self.step_frames(-FRAME_JUMP, model),
            KeyCode::Char('>') => self.step_frames(FRAME_JUMP, model),
            KeyCode::Char('g') => {
                self.plan_top = None;
                self.layout = match self.layout {
                    PlanLayout::Follow => PlanLayout::Open,
                    PlanLayout::Open => PlanLayout::Flat,
                    PlanLayout::Flat => PlanLayout::Follow,
                };
            }
            KeyCode::Up | KeyCode::Char('k') => self.scroll(-1, model, area),
            KeyCode::Down | KeyCode::Char('j') => self.scroll(1, model, area),
            KeyCode::PageUp => self.scroll(-self.page(model, area), model, area),
            KeyCode::PageDown => self.scroll(self.page(model, area), model, area),
            KeyCode::Home => self.scroll(isize::MIN / 2, model, area),
            KeyCode::End => self.scroll(isize::MAX / 2, model, area),
            _ => {}
        }
    }

    /// Handles a key while the prompt is open; returns the action once the line is complete.
    fn edit_prompt(
        &mut self,
        mut prompt: Prompt,
        code: KeyCode,
        model: &NightModel,
    ) -> Option<Action> {
        let (Prompt::Command(text) | Prompt::Filter(text)) = &mut prompt;
        match code {
            KeyCode::Esc => {
                if matches!(prompt, Prompt::Filter(_)) {
                    self.filter.clear();
                }
                return None;
            }
            KeyCode::Backspace if text.is_empty() => return None,
            KeyCode::Backspace => {
                text.pop();
            }
            KeyCode::Enter => {
                return match prompt {
                    Prompt::Filter(text) => Some(Action::Filter(text.to_lowercase())),
                    Prompt::Command(text) => match command::read(&text, model) {
                        Ok(order) => Some(order),
                        Err(answer) => {
                            self.notify(answer);
                            None
                        }
                    },
                };
            }
            KeyCode::Char(c) if text.len() < 200 => text.push(c),
            _ => {}
        }
        if let Prompt::Filter(text) = &prompt {
            (self.filter, self.plan_top) = (text.to_lowercase(), None);
        }
        self.prompt = Some(prompt);
        None
    }

    /// Executes an action on the screen; returns the request to the night, if it is one.
    fn execute(&mut self, order: Action, model: &NightModel, area: Rect) -> Option<NightRequest> {
        match order {
            Action::Night(NightRequest::Stop) => return Some(NightRequest::Stop),
            Action::Night(_) if self.watching => {
                self.notify(
                    "this night is rendered by another process and can only be watched here"
                        .to_owned(),
                );
            }
            Action::Night(command @ (NightRequest::Skip | NightRequest::Restart)) => {
                let current = model.current.as_ref().filter(|current| current.running)?;
                if self.asks_again(command, current.cell, model) {
                    return None;
                }
                if command == NightRequest::Skip {
                    self.skipping = Some(current.cell);
                }
                return Some(command);
            }
            Action::Night(command) => return Some(command),
            Action::Filter(words) => (self.filter, self.plan_top) = (words, None),
            Action::Metric(index) => match model.metrics().len() {
                0 => self.notify("this plan has no metrics".to_owned()),
                n if index >= n => self.notify(format!("the last metric is number {n}")),
                _ => self.metric = index,
            },
            Action::ChartX(axis) => self.chart_x = axis,
            Action::Picture(kind) => {
                (self.picture, self.flicker, self.playing) = (kind, false, None)
            }
            Action::Play => self.toggle_animation(model),
            Action::OpticalLength(length) => {
                (
                    self.picture,
                    self.flicker,
                    self.playing,
                    self.optical_length,
                ) = (PictureMode::Time, false, None, length);
            }
            Action::Flicker => (self.flicker, self.playing) = (!self.flicker, None),
            Action::Exposure(stops) => self.exposure = stops.clamp(-MAX_STOPS, MAX_STOPS),
            Action::Cell(i) => {
                self.filter.clear();
                if self.layout == PlanLayout::Follow {
                    self.layout = PlanLayout::Open;
                }
                let row = self.row_of(CellRef::Cell(i), model);
                let page = panes::plan::page(panes::regions(area, self.focus, model).plan);
                self.plan_top = Some(row.saturating_sub(page / 2));
            }
            Action::Help => self.help = !self.help,
        }
        None
    }

    /// Asks the user to repeat a request that loses rendered work. Returns whether it is to wait.
    fn asks_again(&mut self, request: NightRequest, cell: CellRef, model: &NightModel) -> bool {
        let asked = self.confirmation.take().is_some_and(|asked| {
            (asked.request, asked.cell) == (request, cell) && self.now_s < asked.until_s
        });
        let Some(question) = question(request, cell, model).filter(|_| !asked) else {
            return false;
        };
        self.confirmation = Some(Confirmation {
            request,
            cell,
            until_s: self.now_s + NOTICE_S,
        });
        self.notify(question);
        true
    }

    fn notify(&mut self, text: String) {
        self.notice = Some(Notice {
            text,
            until_s: self.now_s + NOTICE_S,
        });
    }

    fn picture_after(&self, by: usize) -> PictureMode {
        let now = PictureMode::ALL
            .iter()
            .position(|kind| *kind == self.picture)
            .unwrap_or(0);
        PictureMode::ALL[(now + by) % PictureMode::ALL.len()]
    }

    fn page(&self, model: &NightModel, area: Rect) -> isize {
        let regions = panes::regions(area, self.focus, model);
        match self.focus {
            Focus::Log => isize::from(regions.log.height as i16 - 3).max(1),
            _ => (panes::plan::page(regions.plan) as isize - 1).max(1),
        }
    }

    /// Scrolls the log if it is enlarged, otherwise the plan.
    fn scroll(&mut self, by: isize, model: &NightModel, area: Rect) {
        let regions = panes::regions(area, self.focus, model);
        if self.focus == Focus::Log {
            let most = panes::log::lines_back(model, self, regions.log);
            self.log_back = self
                .log_back
                .saturating_add_signed(by.saturating_neg())
                .min(most);
            return;
        }
        let page = panes::plan::page(regions.plan);
        let most = panes::plan::rows(model, self).saturating_sub(page);
        let top = panes::plan::top(model, self, page);
        self.plan_top = Some(top.saturating_add_signed(by).min(most));
    }
}
